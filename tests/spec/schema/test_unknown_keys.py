"""A key that DoDo does not know is told at every level of what people write."""

from collections.abc import Iterator
from typing import Any

import pytest
import yaml

from dodo_dsl.source import parse
from dodo_dsl.spec.schema_errors import schema_of
from dodo_dsl.spec.validation import validate

UNKNOWN = "zzq"
NAMES = {
    "dodo": {"$.application.env", "$.goals", "$.matrix", "$.vary", "$.environment", "$.action", "$.evaluation",
             "$.environment.a.with", "$.action.a.with", "$.evaluation.a.with"},
    "deployment": {"$.rigs", "$.application.services", "$.application.services.a.tune"},
    "machine": {"$.rigs"},
    "service": {"$.parameters", "$.checks", "$.parameters.a.when", "$.messages.cases[0].when"},
}  # fmt: skip
"""Mappings whose keys are names; a rule checks those under ``with``."""
Step = str | int


def levels(schema: Any, root: Any, path: tuple[Step, ...] = ()) -> Iterator[tuple[Step, ...]]:
    """The paths of all mappings that a schema allows: a name is ``a``, and an item of a list 0."""
    if not isinstance(schema, dict):
        return
    if "$ref" in schema:
        yield from levels(root["$defs"][schema["$ref"].rpartition("/")[2]], root, path)
    if "properties" in schema or isinstance(schema.get("additionalProperties"), dict):
        yield path
    for key, below in schema.get("properties", {}).items():
        yield from levels(below, root, (*path, key))
    yield from levels(schema.get("additionalProperties"), root, (*path, "a"))
    yield from levels(schema.get("items"), root, (*path, 0))
    for part in (*schema.get("oneOf", ()), *schema.get("anyOf", ()), *schema.get("allOf", ())):
        yield from levels(part, root, path)


def document(path: tuple[Step, ...]) -> Any:
    """A document with an unknown key at that level."""
    value: Any = {UNKNOWN: 1}
    for step in reversed(path):
        value = [value] if isinstance(step, int) else {step: value}
    return value


def shown(path: tuple[Step, ...]) -> str:
    return "$" + "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)


CASES = [(name, path) for name in NAMES for path in dict.fromkeys(levels(schema_of(name), schema_of(name)))]


@pytest.mark.parametrize(("name", "path"), CASES, ids=[f"{name} {shown(path)}" for name, path in CASES])
def test_an_unknown_key_is_told_where_it_is(name: str, path: tuple[Step, ...]) -> None:
    text = yaml.safe_dump(document(path))
    line = next(number for number, each in enumerate(text.splitlines(), 1) if UNKNOWN in each)
    node, _ = parse(text, "a.yml")
    assert node is not None
    told = [d for d in validate(node, name) if d.rule == "unknown-key" and UNKNOWN in d.message]
    assert [d.span.line for d in told] == ([] if shown(path) in NAMES[name] else [line])


def test_the_levels_are_found() -> None:
    found = {shown(path) for name, path in CASES if name == "deployment"}
    assert {"$", "$.sandbox", "$.rigs.a.camera.intrinsics", "$.rigs.a.axes.yaw"} <= found
