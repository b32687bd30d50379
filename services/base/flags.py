"""Flags in OpenDLV style, ``--key=value``, made from the service's manifest."""

import difflib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from services.base.manifest import About, bounds, example, parameters, unit

Value = int | float | str | bool | list[str] | None

_FLAG = re.compile(r"--(?P<name>[A-Za-z][A-Za-z0-9.-]*)(?:=(?P<value>.*))?", re.DOTALL)
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]{1,3})?")
_INTEGER = re.compile(r"[-+]?[0-9]{1,20}")
_KINDS = {
    "number": "a finite number",
    "integer": "a whole number",
    "boolean": "true or false",
    "path": "a path",
    "memory": "a name",
    "output": "a file to write",
}
_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}


class FlagsError(ValueError):
    """A command line that the manifest does not allow; one sentence."""


@dataclass(frozen=True)
class Flags(Mapping[str, Any]):
    """Values by parameter name, defaults filled in; an optional parameter without default is None.

    A ``number`` is a float, an ``integer`` an int, a ``list`` a list of strings, a ``boolean`` a bool, everything else
    a string; numbers are in the manifest's unit.
    """

    values_by_name: Mapping[str, Any]

    def __getitem__(self, name: str) -> Any:
        return self.values_by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.values_by_name)

    def __len__(self) -> int:
        return len(self.values_by_name)


def parse(manifest: Mapping[str, Any], argv: Sequence[str]) -> Flags:
    """The values that a command line gives; raises FlagsError."""
    known = parameters(manifest)
    given: dict[str, Value] = {}
    for word in argv:
        name, text = _split(word)
        if name not in known:
            raise FlagsError(f"unknown flag '--{name}'{_near(name, known)}")
        if name in given:
            raise FlagsError(f"--{name} is given twice")
        given[name] = _value(name, known[name], text)
    for name, about in known.items():
        if about.get("required") and name not in given:
            raise FlagsError(f"--{name} is missing: {about['help']}")
    return Flags({name: given.get(name, _default(about)) for name, about in known.items()})


def _split(word: str) -> tuple[str, str | None]:
    match = _FLAG.fullmatch(word)
    if match is None:
        raise FlagsError(f"'{word}' is not a flag, expected --key=value")
    return match["name"], match["value"]


def _default(about: About) -> Value:
    value: Value = about.get("default")
    return float(value) if about["type"] == "number" and isinstance(value, int) else value


def _near(name: str, known: Mapping[str, object]) -> str:
    close = difflib.get_close_matches(name, [*known, "help"], n=1)
    return f", did you mean '--{close[0]}'?" if close else "; --help lists all flags"


def _value(name: str, about: About, text: str | None) -> Value:
    kind = about["type"]
    if text is None:
        if kind == "boolean":
            return True
        raise FlagsError(f"--{name} has no value, expected --{name}={example(about)}")
    value = _CONVERTERS.get(kind, str)(text) if text or kind in ("string", "list") else None
    if value is None:
        raise FlagsError(f"--{name}={text} is not {_expected(about)}")
    if about.get("choices") and value not in about["choices"]:
        raise FlagsError(f"--{name}={text} is not one of {bounds(about)}")
    if not _allowed(about, value):
        raise FlagsError(f"--{name}={text} is out of range, expected {bounds(about)}{unit(about)}")
    return value


def _allowed(about: About, value: Value) -> bool:
    if not isinstance(value, int | float):
        return True
    low, high = about.get("minimum"), about.get("maximum")
    return (low is None or value >= low) and (high is None or value <= high)


def _number(text: str) -> float | None:
    value = float(text) if _NUMBER.fullmatch(text) else None
    return value if value is not None and value - value == 0.0 else None


_CONVERTERS: dict[str, Callable[[str], Value]] = {
    "number": _number,
    "integer": lambda text: int(text) if _INTEGER.fullmatch(text) else None,
    "boolean": lambda text: _BOOLEANS.get(text.lower()),
    "list": lambda text: [part for part in text.split(",") if part],
}


def _expected(about: About) -> str:
    return _KINDS[about["type"]] + (f" in{unit(about)}" if unit(about) else "")
