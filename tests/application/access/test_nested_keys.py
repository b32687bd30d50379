"""The keys below those of a service are those of compose's schema, and others are told where they are."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl.application.access.compose_keys import BELOW
from dodo_dsl.application.access.model import Access
from dodo_dsl.application.read import read_application
from dodo_dsl.spec.sandbox_limits import SandboxLimits
from tests.application.access.compose_forms import schema

NESTED = {path: tuple(rows) for path, rows in BELOW.items()}
UNUSED = ("develop", "extends", "models", "post_start", "pre_start", "pre_stop", "provider")
"""What a test's copy does not have, and what is merged before."""


def mappings(node: Any, path: str = "", seen: tuple[str, ...] = ()) -> Iterator[tuple[str, set[str]]]:
    """The keys of each mapping in compose's schema of a service, by their paths."""
    if not isinstance(node, dict):
        return
    if "properties" in node and path:
        yield path[1:], set(node["properties"])
    name = node.get("$ref", "").rpartition("/")[2]
    below = [("", schema()["$defs"][name])] if name and name not in seen else []
    below += [(f".{key}", inner) for key, inner in node.get("properties", {}).items() if path or key not in UNUSED]
    below += [(".*", inner) for key, inner in node.get("patternProperties", {}).items() if key != "^x-"]
    below += [(".*", node.get("additionalProperties")), (".*", node.get("items"))]
    below += [("", part) for key in ("oneOf", "anyOf", "allOf") for part in node.get(key, ())]
    for step, inner in below:
        yield from mappings(inner, path + step, (*seen, name))


def test_the_keys_are_those_of_composes_schema() -> None:
    found = dict(mappings(schema()["$defs"]["service"]))
    assert {path: set(keys) for path, keys in NESTED.items()} == found


@pytest.mark.parametrize("path", NESTED)
def test_an_unknown_key_is_told_where_it_is(tmp_path: Path, path: str) -> None:
    known = {"path": "a.env"} if path.startswith("env_file") else {}
    value: Any = {**known, f"{NESTED[path][-1]}x": 1}
    for step in reversed(path.split(".")):
        listed = step == "*" and not path.startswith(("build.ulimits", "depends_on", "networks", "ulimits"))
        value = [value] if listed else {"b" if step == "*" else step: value}
    services = {"a": {"image": "x", "command": "--cid=111", **value}, "b": {"image": "x", "command": "--cid=111"}}
    (tmp_path / "a.env").touch()
    file = tmp_path / "docker-compose.yml"
    file.write_text(yaml.safe_dump({"services": services}))
    line = next(n for n, each in enumerate(file.read_text().splitlines(), 1) if f"{NESTED[path][-1]}x:" in each)
    _, found = read_application([file], Access((str(tmp_path),)), SandboxLimits())
    (told,) = (d for d in found if d.rule == "unknown-key")
    assert told.span.line == line
    assert f"'{NESTED[path][-1]}'" in told.hint
