"""Flags in OpenDLV style, ``--key=value``, made from the service's manifest."""

import difflib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

Value = int | float | str | bool | list[str] | None

COMMON: dict[str, dict[str, Any]] = {
    "cid": {"type": "integer", "required": True, "minimum": 1, "maximum": 254, "help": "Session of the bus to join."},
    "id": {
        "type": "integer",
        "default": 0,
        "minimum": 0,
        "maximum": 4_294_967_295,
        "help": "Sender stamp of what is sent, where no parameter says otherwise.",
    },
    "verbose": {"type": "boolean", "default": False, "help": "Say more about what happens."},
}
_FLAG = re.compile(r"--(?P<name>[A-Za-z][A-Za-z0-9.-]*)(?:=(?P<value>.*))?", re.DOTALL)
_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}


class FlagsError(ValueError):
    """A command line that the manifest does not allow; one sentence."""


@dataclass(frozen=True)
class Flags:
    """Values by parameter name, defaults filled in; an optional parameter without default is None."""

    values: Mapping[str, Any]

    def __getitem__(self, name: str) -> Any:
        return self.values[name]


def load_manifest(folder: Path) -> dict[str, Any]:
    """The service's own ``service.yml``."""
    manifest: dict[str, Any] = yaml.safe_load((folder / "service.yml").read_text(encoding="utf-8"))
    return manifest


def parameters(manifest: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """All flags of a service, the common ones last."""
    return {**(manifest.get("parameters") or {}), **COMMON}


def parse(manifest: Mapping[str, Any], argv: Sequence[str]) -> Flags:
    """The values that a command line gives; raises FlagsError."""
    known = parameters(manifest)
    values: dict[str, Any] = {name: about.get("default") for name, about in known.items()}
    given = set()
    for word in argv:
        match = _FLAG.fullmatch(word)
        if not match:
            raise FlagsError(f"'{word}' is no flag, expected --key=value")
        name = match["name"]
        if name not in known:
            raise FlagsError(f"there is no flag '--{name}'{_near(name, known)}")
        values[name] = _value(name, known[name], match["value"])
        given.add(name)
    for name, about in known.items():
        if about.get("required") and name not in given:
            raise FlagsError(f"--{name} is missing: {about['help']}")
    return Flags(values)


def _near(name: str, known: Mapping[str, object]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f", did you mean '--{close[0]}'?" if close else "; --help shows all"


def _value(name: str, about: Mapping[str, Any], text: str | None) -> Value:
    kind = about["type"]
    if text is None:
        if kind == "boolean":
            return True
        raise FlagsError(f"--{name} has no value, expected --{name}={_placeholder(about)}")
    value = _CONVERTERS.get(kind, str)(text) if text or kind in ("string", "list") else None
    if value is None:
        raise FlagsError(f"--{name}={text} is not {_expected(about)}")
    return _bounded(name, about, value, text)


def _bounded(name: str, about: Mapping[str, Any], value: Value, text: str) -> Value:
    choices = about.get("choices")
    if choices and value not in choices:
        raise FlagsError(f"--{name}={text} is none of {', '.join(choices)}")
    if isinstance(value, int | float):
        low, high = about.get("minimum"), about.get("maximum")
        if (low is not None and value < low) or (high is not None and value > high):
            raise FlagsError(f"--{name}={text} is out of range, expected {_bounds(about)}{_unit(about)}")
    return value


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if value - value == 0.0 else None


def _integer(text: str) -> int | None:
    return int(text) if re.fullmatch(r"[-+]?\d{1,20}", text, re.ASCII) else None


_CONVERTERS: dict[str, Callable[[str], Value]] = {
    "number": _number,
    "integer": _integer,
    "boolean": lambda text: _BOOLEANS.get(text.lower()),
    "list": lambda text: [part for part in text.split(",") if part],
}


def _unit(about: Mapping[str, Any]) -> str:
    return f" {about['unit']}" if about.get("unit") else ""


def _bounds(about: Mapping[str, Any]) -> str:
    low, high = about.get("minimum"), about.get("maximum")
    if low is not None and high is not None:
        return f"{low} to {high}"
    if low is not None:
        return f"at least {low}"
    return f"at most {high}" if high is not None else ""


def _expected(about: Mapping[str, Any]) -> str:
    names = {"number": "a finite number", "integer": "a whole number", "boolean": "true or false"}
    return names.get(about["type"], "a text") + (f" in {about['unit']}" if about.get("unit") else "")


def _placeholder(about: Mapping[str, Any]) -> str:
    default = about.get("default")
    if isinstance(default, list):
        return ",".join(map(str, default)) or "A,B"
    examples = {"path": "FOLDER", "string": "TEXT", "list": "A,B", "integer": "111"}
    return str(default) if default is not None else examples.get(about["type"], "1")


def help_text(manifest: Mapping[str, Any]) -> str:
    """``--help``: what the service does, its flags with units, bounds and defaults, and a line that runs."""
    known = parameters(manifest)
    module = " ".join(manifest["process"])
    lines = [f"{manifest['name']}: {manifest['description']}", "", f"usage: {module} --key=value ...", ""]
    for name, about in known.items():
        facts = [about["type"] + _unit(about), _bounds(about)]
        if about.get("required"):
            facts.append("required")
        elif about.get("default") not in (None, []):
            facts.append(f"default {_placeholder(about)}")
        lines.append(f"  --{name}  ({', '.join(f for f in facts if f)})")
        lines.append(f"      {about['help']}")
    required = [f"--{n}={_placeholder(a)}" for n, a in known.items() if a.get("required")]
    return "\n".join([*lines, "", f"example: {module} {' '.join(required)}"]) + "\n"
