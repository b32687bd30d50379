"""Leaves out schema errors that only follow from another one, so that each mistake is reported once."""

from collections.abc import Iterable, Iterator
from typing import Any

from dodo_dsl.spec.slips import meant

Path = tuple[str | int, ...]
_BOUNDS = ("minimum", "maximum")


def without_consequences(errors: Iterable[Any]) -> list[Any]:
    """The errors of jsonschema without what follows from others.

    Those are missing keys that are misspelt, empty ones whose content is not indented, and bounds of what is no number
    of the expected kind.
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
