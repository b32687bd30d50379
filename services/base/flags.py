"""Flags in OpenDLV style, ``--key=value``, by the service's manifest, which the compiler validates."""

import argparse
import math
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
_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}


def _number(text: str) -> float | None:
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    return value if math.isfinite(value) else None


def _amount(text: str) -> float | Share | None:
    number = _number(text.removesuffix("%"))
    return number if number is None or not text.endswith("%") else Share(number / 100)


def _text(text: str) -> str | None:
    return text or None


_KINDS: dict[str, tuple[str, Callable[[str], Value]]] = {
    "number": ("a finite number", _number),
    "integer": ("a whole number", lambda text: int(text) if _INTEGER.fullmatch(text) else None),
    "amount": ("a finite number", _amount),
    "boolean": ("true or false", lambda text: _BOOLEANS.get(text.lower())),
    "path": ("a path", _text),
    "memory": ("a name", _text),
    "output": ("a file to write", _text),
    "list": ("a list of items with commas between them", lambda text: [part for part in text.split(",") if part]),
}
"""What a value of each type is, and its reader, which gives None for anything else."""


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
    return Flags({name: given.get(name, _default(about)) for name, about in known.items()})


def _default(about: About) -> Value:
    value: Value = about.get("default")
    return float(value) if about["type"] in ("number", "amount") and isinstance(value, int) else value


def _value(name: str, about: About, text: str) -> Value:
    if "of" in about:
        item = {**{key: fact for key, fact in about.items() if key != "of"}, "type": about["of"]}
        return [_value(name, item, part) for part in text.split(",") if part]
    kind, read = _KINDS.get(about["type"], ("a text", str))
    value, expected = read(text), kind + (f" in{unit(about)}" if unit(about) else "")
    amount = value.of_one if isinstance(value, Share) else value
    low, high = about.get("minimum", -math.inf), about.get("maximum", math.inf)
    if value is None:
        raise FlagsError(f"--{name}={text} is not {expected}")
    if about.get("choices") and value not in about["choices"]:
        raise FlagsError(f"--{name}={text} is not one of {bounds(about)}")
    if isinstance(value, Share) and not about.get("or-share"):
        raise FlagsError(f"--{name}={text} is a share, expected {expected}")
    if isinstance(value, int) and value % (step := about.get("multiple-of", 1)):
        raise FlagsError(f"--{name}={text} is not a multiple of {step}")
    if isinstance(amount, int | float) and not low <= amount <= high:
        raise FlagsError(f"--{name}={text} is out of range, expected {bounds(about)}{unit(about)}")
    return value


def example_line(manifest: Mapping[str, Any]) -> str:
    """A command that starts the service alone: with the manifest's example, or else with required flags."""
    known = parameters(manifest)
    required = [f"--{name}={example_of(about)}" for name, about in known.items() if about.get("required")]
    words = [f"--cid={example_of(known['cid'])}", *manifest["example"]] if "example" in manifest else required
    return shlex.join([*manifest["process"], *words])


def _help(about: About) -> str:
    facts = [about["type"] + unit(about), bounds(about)]
    if about.get("default") not in (None, [], ""):
        facts.append(f"default {example_of({'default': about['default'], 'type': about['type']})}")
    return f"{about['help']} ({', '.join(filter(None, facts))})".replace("%", "%%")
