"""Slips within keys that are YAML nonetheless: ``{uses:camera}``, ``level:: sil``, ``{freq 10 Hz}``."""

import re
from collections.abc import Collection
from dataclasses import dataclass

from dodo_dsl.diagnostics import Fix, closest
from dodo_dsl.slips.failure import shortened

_COLON = re.compile(r"(?P<key>[^:\s]+):(?P<value>.*)", re.DOTALL)
_CLOSING = {"{": "}", "[": "]"}
_BLANK = re.compile(r"(?P<key>[^\s=]+)[\s=]+(?P<value>.+)", re.DOTALL)


@dataclass(frozen=True)
class KeySlip:
    """An unknown key; ``key`` is the known one that is meant."""

    key: str
    message: str
    hint: str
    fix: Fix | None = None


def slip_in_key(word: str, known: Collection[str], *, is_empty: bool) -> KeySlip | None:
    """What is wrong with an unknown key, ``is_empty`` if it has no value; None when it is no slip of this kind."""
    found = _COLON.fullmatch(word)
    if found and found["key"] in known:
        key, value = found["key"], found["value"].strip()
        if value:
            message = f"a space is missing after the colon of '{key}'"
            return KeySlip(key, message, _write(key, value), Fix(word, f"{key}: {value}"))
        return KeySlip(key, f"there is one colon too many after '{key}'", f"write '{key}: ...'")
    found = _BLANK.fullmatch(word) if is_empty else None
    if found and found["key"] in known:
        key = found["key"]
        return KeySlip(key, f"a colon is missing after '{key}'", _write(key, found["value"]))
    return None


def _write(key: str, value: str) -> str:
    closing = _CLOSING.get(value[0], "")
    if closing not in value:  # the key ends at the first colon within the brackets
        value = f"{value[0]}...{closing}"
    return f"write '{key}: {shortened(value)}'"


def meant(word: str, known: Collection[str], *, is_empty: bool) -> str:
    """The known key that an unknown one most likely means; empty when there is none."""
    if found := slip_in_key(word, known, is_empty=is_empty):
        return found.key
    return next(iter(closest(word, known)), "")
