"""JSON Schema's errors: whether a document has any, found quickly, and which only follow from another one.

Most documents fit; of those that do not, ``validation`` shows what is wrong. jsonschema-rs finds that out in 25 ms of a
processor a command; jsonschema needs 110 ms, with its import. Of ``dodo compile --check`` on the tests that ship that
is a tenth: 0.87 s of a processor in place of 0.96 s, in other runs 0.76 s in place of 0.84 s (medians of 20 runs each
in turns, on two busy cores).

Errors that only follow from another one are left out, so that each mistake is reported once.
"""

import functools
import json
import math
from collections.abc import Iterable, Iterator
from typing import Any

from dodo_dsl import package_data
from dodo_dsl.spec import quantity
from dodo_dsl.spec.slips import meant

OF_COMPOSE = "application"
UNIT = "x-unit"
_OTHER, _OWN = "application.schema.json#/", "#/$defs/"
WORDS = "x-words"
"""Allowed in place of a quantity."""


def check_quantity(unit: str, instance: object, schema: dict[str, Any]) -> None:
    """The keyword ``x-unit``, for strings; raises QuantityError. Numbers are left to the keyword ``type``."""
    if isinstance(instance, str) and instance not in schema.get(WORDS, ()):
        quantity.convert(instance, unit)


def written_schema(name: str) -> dict[str, Any]:
    """``schemas/<name>.schema.json`` with what it takes from the schema of compose files."""
    text = (package_data.schemas() / f"{name}.schema.json").read_text(encoding="utf-8")
    schema: dict[str, Any] = json.loads(text)
    return _with_others(schema, {}) if f'"{_OTHER}' in text else schema


def _with_others(part: Any, compose: dict[str, Any]) -> Any:
    """A part of a schema with the parts of compose's, which is read once, in place of references to them."""
    if isinstance(part, list):
        return [_with_others(item, compose) for item in part]
    if not isinstance(part, dict):
        return part
    found = {key: _with_others(value, compose) for key, value in part.items() if key != "$ref"}
    if "$ref" not in part:
        return found
    if not str(part["$ref"]).startswith(_OTHER):
        return {"$ref": part["$ref"], **found}
    compose = compose or written_schema(OF_COMPOSE)
    target: Any = compose
    for step in str(part["$ref"]).removeprefix(_OTHER).split("/"):
        target = target[step]
    return {**_self_contained(target, compose), **found}


def _self_contained(part: Any, compose: dict[str, Any]) -> Any:
    """A part of compose's schema without references within it."""
    if isinstance(part, list):
        return [_self_contained(item, compose) for item in part]
    if not isinstance(part, dict):
        return part
    name = str(part.get("$ref", "")).removeprefix(_OWN)
    base = _self_contained(compose["$defs"][name], compose) if name else {}
    return {**base, **{key: _self_contained(value, compose) for key, value in part.items() if key != "$ref"}}


def schema_of(name: str) -> dict[str, Any]:
    """``schemas/<name>.schema.json`` without what is for editors alone."""
    schema = written_schema(name)
    if (use := schema.get("$defs", {}).get("use")) is not None:
        use.pop("allOf")  # for editors; the rules give better messages
        use["required"] = ["uses"]  # what a test extends is merged here, of which editors know nothing
        schema["else"].pop("properties")
    return schema


class _Quantity:
    def __init__(self, schema: dict[str, Any], unit: str, _path: object) -> None:
        self._schema, self._unit = schema, unit

    def validate(self, instance: object) -> None:
        check_quantity(self._unit, instance, self._schema)


@functools.cache
def _validator(name: str) -> Any:
    import jsonschema_rs

    return jsonschema_rs.Draft202012Validator(schema_of(name), keywords={UNIT: _Quantity})


def is_valid(document: object, schema: str) -> bool:
    """Whether a document certainly fits ``schemas/<schema>.schema.json``; not so for one that JSON cannot express.

    For JSON Schema 1.0 is a whole number, and for compose: with fractions in place of such numbers, those at a wrong
    position show.
    """
    try:
        validator = _validator(schema)
        return bool(
            validator.is_valid(document) and (schema == OF_COMPOSE or validator.is_valid(_fractional(document)))
        )
    except (ValueError, OverflowError, RecursionError):
        return False


def is_whole(_: object, value: object) -> bool:
    """Whether a value is written as a whole number: 140, but neither 140.0 nor 1.4e2."""
    return isinstance(value, int) and not isinstance(value, bool)


def _fractional(value: Any) -> Any:
    """The same with numbers such as 1.0 moved by the least amount."""
    if isinstance(value, dict):
        return {key: _fractional(below) for key, below in value.items()}
    if isinstance(value, list):
        return [_fractional(item) for item in value]
    return math.nextafter(value, math.inf) if isinstance(value, float) and value.is_integer() else value


Path = tuple[str | int, ...]
_BOUNDS = ("minimum", "maximum")


def without_consequences(errors: Iterable[Any]) -> list[Any]:
    """The errors of jsonschema without what follows from others.

    Those are missing keys that are misspelt, empty ones whose content is not indented, and bounds of what is not a
    number of the expected kind.
    """
    typed = list(errors)
    wrong = {tuple(error.absolute_path) for error in typed if error.validator == "type"}
    kept = [error for error in typed if not (error.validator in _BOUNDS and tuple(error.absolute_path) in wrong)]
    follows = {consequence for error in kept if error.validator == "additionalProperties" for consequence in _of(error)}
    return [error for error in kept if not follows & set(_is(error))]


def _of(error: Any) -> Iterator[tuple[str, Path]]:
    path, known = tuple(error.absolute_path), error.schema.get("properties", {})
    for name, value in error.instance.items():
        if name not in known:
            yield "missing", (*path, meant(name, known, is_empty=value is None))
    for key in unindented(error.instance, known).values():
        yield "empty", (*path, key)


def _is(error: Any) -> Iterator[tuple[str, Path]]:
    path = tuple(error.absolute_path)
    if error.validator == "required":
        yield "missing", (*path, error.validator_value)
    elif error.validator == "type" and error.instance is None:
        yield "empty", path


def unindented(instance: dict[str, Any], known: Iterable[str]) -> dict[str, str]:
    """Unknown keys with a mapping that follow an empty known one, by which they are perhaps to be indented."""
    names, empty, found = set(known), "", {}
    for name, value in instance.items():
        if name in names:
            empty = name if value is None else ""
        elif empty and isinstance(value, dict):
            found[name] = empty
    return found
