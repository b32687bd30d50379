"""What the schemas say about keys: of tests, and of ``dodo.yml``."""

import functools
import json
from typing import Any

from dodo_dsl import package_data
from dodo_dsl.lsp.tree import Steps

Schema = dict[str, Any]


@functools.cache
def _document(name: str) -> Schema:
    found: Schema = json.loads((package_data.schemas() / f"{name}.schema.json").read_text(encoding="utf-8"))
    return found


def at(name: str, steps: Steps) -> Schema | None:
    """The part of a schema that describes what is below the keys; None for unknown ones."""
    part: Schema | None = _document(name)
    for step in steps:
        if part is None:
            return None
        part = _below(_whole(name, part), step)
    return _whole(name, part) if part is not None else None


def _below(part: Schema, step: str | int) -> Schema | None:
    if isinstance(step, int):
        found = part.get("items")
    else:
        found = part.get("properties", {}).get(step, part.get("additionalProperties"))
    return found if isinstance(found, dict) else None


def _whole(name: str, part: Schema) -> Schema:
    """A part with what it refers to."""
    reference = part.get("$ref", "")
    if not reference.startswith("#/$defs/"):
        return part
    target: Schema = _document(name)["$defs"][reference.removeprefix("#/$defs/")]
    return {**target, **part}


def values(part: Schema) -> list[str]:
    """The values that are allowed, or examples."""
    if "const" in part:
        return [str(part["const"])]
    if part.get("type") == "boolean":
        return ["true", "false"]
    written: list[Any] = part.get("enum") or part.get("examples") or []
    return [str(value) for value in written if not isinstance(value, list | dict)]
