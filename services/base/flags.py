"""Flags in OpenDLV style, ``--key=value``, by the service's manifest, which the compiler validates."""

import argparse
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import yaml

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

About = Mapping[str, Any]

COMMON: dict[str, About] = {
    "cid": {
        "type": "integer",
        "required": True,
        "minimum": 1,
        "maximum": 254,
        "example": 128,
        "help": "Session of the bus to join.",
    },
    "id": {
        "type": "integer",
        "default": 0,
        "minimum": 0,
        "maximum": 4_294_967_295,
        "help": "Sender stamp of messages, where no parameter sets another.",
    },
    "ends-input": {
        "type": "boolean",
        "default": False,
        "help": "End the input of all others, so that they give their verdict, with the own verdict.",
    },
    "verbose": {"type": "boolean", "default": False, "help": "Log more."},
}


def load_manifest(folder: Path) -> dict[str, Any]:
    manifest: dict[str, Any] = yaml.load((folder / "service.yml").read_text(encoding="utf-8"), _LOADER)  # noqa: S506
    return manifest


def parameters(manifest: Mapping[str, Any]) -> dict[str, About]:
    """All flags of a service, the common ones last; its own parameter replaces a common one of its name."""
    own: dict[str, About] = manifest.get("parameters") or {}
    return {**own, **{name: about for name, about in COMMON.items() if name not in own}}


def unit(about: About) -> str:
    """`` Hz``, or nothing; shares, whose unit is 1, have none."""
    return "" if about.get("unit") in (None, "", "1") else f" {about['unit']}"


def bounds(about: About) -> str:
    low, high = about.get("minimum"), about.get("maximum")
    if about.get("choices"):
        return ", ".join(about["choices"])
    if low is not None and high is not None:
        return f"{low} to {high}"
    if low is not None:
        return f"at least {low}"
    return f"at most {high}" if high is not None else ""


def example_of(about: About) -> str:
    for value in (about.get("example"), about.get("default"), (about.get("choices") or [None])[0]):
        if isinstance(value, bool):
            return str(value).lower()
        if value not in (None, []):
            return ",".join(map(str, value)) if isinstance(value, list) else str(value)
    words = {"path": "FOLDER", "string": "TEXT", "memory": "NAME", "list": "A,B"}
    return words.get(about["type"]) or str(about.get("minimum", 1))


class Share(NamedTuple):
    """An amount that is written as a share, such as 25 % of a target: 0.25."""

    of_one: float


class Flags(dict[str, Any]):
    """Values by parameter name, defaults filled in; an optional parameter without default is None.

    A ``number`` is a float, an ``amount`` a float or a Share, an ``integer`` an int, a ``list`` a list of strings or
    of what its ``of`` says, a ``boolean`` a bool, everything else a string; numbers are in the manifest's unit.
    """


Value = int | float | str | bool | list[Any] | Share | None

_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]{1,3})?")
_INTEGER = re.compile(r"[-+]?[0-9]{1,20}")
_KINDS = {
    "number": "a finite number",
    "integer": "a whole number",
    "amount": "a finite number",
    "boolean": "true or false",
    "path": "a path",
    "memory": "a name",
    "output": "a file to write",
    "list": "a list of items with commas between them",
}
_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}


class FlagsError(ValueError):
    """A command line that the manifest does not allow; one sentence."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise FlagsError(message)


def parser(manifest: Mapping[str, Any]) -> argparse.ArgumentParser:
    """Parses a service's command line, and says in its help what the service does."""
    example = f"example: {example_line(manifest)}"
    command = " ".join(manifest["process"])
    found = _Parser(command, "%(prog)s --key=value ...", manifest["description"], example, allow_abbrev=False)
    for name, about in parameters(manifest).items():
        more: dict[str, Any] = {"nargs": "?", "const": "true"} if about["type"] == "boolean" else {}
        more |= {"required": bool(about.get("required")), "default": argparse.SUPPRESS, "help": _help(about)}
        found.add_argument(f"--{name}", dest=name, metavar=example_of(about), **more)
    return found


def parse(manifest: Mapping[str, Any], argv: Sequence[str]) -> Flags:
    """The values that a command line gives; raises FlagsError."""
    known, words = parameters(manifest), vars(parser(manifest).parse_args(argv))
    given = {name: _value(name, known[name], text) for name, text in words.items()}
    for group in manifest.get("one-of") or ():
        if not any(name in given for name in group):
            raise FlagsError(f"give one or more of --{', --'.join(group)}")
    values = Flags({name: given.get(name, _default(about)) for name, about in known.items()})
    for name in given:
        for other, wanted in (known[name].get("when") or {}).items():
            if ("" if values[other] is None else values[other]) not in wanted:
                raise FlagsError(f"--{name} is for {_wanted(other, wanted)}")
    return values


def _default(about: About) -> Value:
    value: Value = about.get("default")
    return float(value) if about["type"] in ("number", "amount") and isinstance(value, int) else value


def _value(name: str, about: About, text: str) -> Value:
    kind = about["type"]
    if "of" in about:
        item = {**{key: fact for key, fact in about.items() if key != "of"}, "type": about["of"]}
        return [_value(name, item, part) for part in text.split(",") if part]
    value = _CONVERTERS.get(kind, str)(text) if text or kind in ("string", "list") else None
    expected = _KINDS.get(kind, "") + (f" in{unit(about)}" if unit(about) else "")
    if value is None:
        raise FlagsError(f"--{name}={text} is not {expected}")
    if about.get("choices") and value not in about["choices"]:
        raise FlagsError(f"--{name}={text} is not one of {bounds(about)}")
    if isinstance(value, Share) and not about.get("or-share"):
        raise FlagsError(f"--{name}={text} is a share, expected {expected}")
    if isinstance(value, int) and value % (step := about.get("multiple-of", 1)):
        raise FlagsError(f"--{name}={text} is not a multiple of {step}")
    if not _allowed(about, value):
        raise FlagsError(f"--{name}={text} is out of range, expected {bounds(about)}{unit(about)}")
    return value


def _allowed(about: About, value: Value) -> bool:
    value = value.of_one if isinstance(value, Share) else value
    if not isinstance(value, int | float):
        return True
    low, high = about.get("minimum"), about.get("maximum")
    return (low is None or value >= low) and (high is None or value <= high)


def _number(text: str) -> float | None:
    value = float(text) if _NUMBER.fullmatch(text) else None
    return value if value is not None and value - value == 0.0 else None


def _amount(text: str) -> float | Share | None:
    number = _number(text.removesuffix("%"))
    return number if number is None or not text.endswith("%") else Share(number / 100)


_CONVERTERS: dict[str, Callable[[str], Value]] = {
    "number": _number,
    "amount": _amount,
    "integer": lambda text: int(text) if _INTEGER.fullmatch(text) else None,
    "boolean": lambda text: _BOOLEANS.get(text.lower()),
    "list": lambda text: [part for part in text.split(",") if part],
}


def example_line(manifest: Mapping[str, Any]) -> str:
    """A command that starts the service alone: with the manifest's example, or else with required flags."""
    known = parameters(manifest)
    required = [f"--{name}={example_of(about)}" for name, about in known.items() if about.get("required")]
    words = [f"--cid={example_of(known['cid'])}", *manifest["example"]] if "example" in manifest else required
    return shlex.join([*manifest["process"], *words])


def _wanted(name: str, values: Sequence[str | bool]) -> str:
    return f"--{name}={' or '.join(str(value).lower() for value in values if value != '')}"


def _help(about: About) -> str:
    facts = [about["type"] + unit(about), bounds(about)]
    if about.get("default") not in (None, [], ""):
        facts.append(f"default {example_of({'default': about['default'], 'type': about['type']})}")
    facts += [f"with {_wanted(other, wanted)}" for other, wanted in (about.get("when") or {}).items()]
    return f"{about['help']} ({', '.join(filter(None, facts))})".replace("%", "%%")
