"""Flags in OpenDLV style, ``--key=value``, by the service's manifest, which the compiler validates."""

import argparse
import math
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import yaml

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

About = Mapping[str, Any]


def load_manifest(folder: Path) -> dict[str, Any]:
    return _loaded(folder / "service.yml")


def _loaded(file: Path) -> dict[str, Any]:
    read: dict[str, Any] = yaml.load(file.read_text(encoding="utf-8"), _LOADER)  # noqa: S506
    return read


def parameters(manifest: Mapping[str, Any]) -> dict[str, About]:
    """All flags of a service, the common ones last; its own parameter replaces a common one of its name."""
    own: dict[str, About] = manifest.get("parameters") or {}
    common = _loaded(Path(__file__).with_suffix(".yml"))
    return own | {name: about for name, about in common.items() if name not in own}


_LIMITS = {"minimum": "at least", "maximum": "at most", "multiple-of": "a multiple of"}


def facts(about: About) -> str:
    """What a parameter takes: ``number in Hz, at least 1, at most 1000``; shares, whose unit is 1, have none."""
    unit = "" if about.get("unit") in (None, "", "1") else f" in {about['unit']}"
    kinds = {"amount": "number or share" if about.get("or-share") else "number", "boolean": "true or false"}
    kind = kinds.get(about["type"]) or about["type"]
    choices = [f"one of {', '.join(about['choices'])}"] if about.get("choices") else []
    return ", ".join(
        [kind + unit, *(f"{word} {about[key]}" for key, word in _LIMITS.items() if key in about), *choices]
    )


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


_READERS: dict[str, Callable[[str], Value]] = {
    "number": _number,
    "integer": lambda text: int(text) if _INTEGER.fullmatch(text) else None,
    "amount": _amount,
    "boolean": lambda text: _BOOLEANS.get(text.lower()),
    "path": lambda text: text or None,
    "memory": lambda text: text or None,
    "output": lambda text: text or None,
    "list": lambda text: [part for part in text.split(",") if part],
}
"""By type, what gives the value of a text, and None for what is none; other types are texts."""


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
        more: dict[str, Any] = {"nargs": "?", "const": True} if about["type"] == "boolean" else {}
        more |= {"required": bool(about.get("required")), "default": argparse.SUPPRESS, "help": _help(about)}
        found.add_argument(f"--{name}", dest=name, metavar=example_of(about), type=partial(_value, about), **more)
    return found


def parse(manifest: Mapping[str, Any], argv: Sequence[str]) -> Flags:
    """The values that a command line gives; raises FlagsError."""
    given = vars(parser(manifest).parse_args(argv))
    for group in manifest.get("one-of") or ():
        if not any(name in given for name in group):
            raise FlagsError(f"give one or more of --{', --'.join(group)}")
    return Flags({name: given.get(name, _default(about)) for name, about in parameters(manifest).items()})


def _default(about: About) -> Value:
    value: Value = about.get("default")
    return float(value) if about["type"] in ("number", "amount") and isinstance(value, int) else value


def _value(about: About, text: str) -> Value:
    if "of" in about:
        item = {**{key: fact for key, fact in about.items() if key != "of"}, "type": about["of"]}
        return [_value(item, part) for part in text.split(",") if part]
    value = _READERS.get(about["type"], str)(text)
    amount = value.of_one if isinstance(value, Share) else value
    low, high = about.get("minimum", -math.inf), about.get("maximum", math.inf)
    fits = (
        value is not None
        and (not about.get("choices") or value in about["choices"])
        and (not isinstance(value, Share) or about.get("or-share"))
        and not (isinstance(value, int) and value % about.get("multiple-of", 1))
        and (not isinstance(amount, int | float) or low <= amount <= high)
    )
    if not fits:
        raise argparse.ArgumentTypeError(f"'{text}', expected {facts(about)}")
    return value


def example_line(manifest: Mapping[str, Any]) -> str:
    """A command that starts the service alone: with the manifest's example, or else with required flags."""
    known = parameters(manifest)
    required = [f"--{name}={example_of(about)}" for name, about in known.items() if about.get("required")]
    words = [f"--cid={example_of(known['cid'])}", *manifest["example"]] if "example" in manifest else required
    return shlex.join([*manifest["process"], *words])


def _help(about: About) -> str:
    default = about.get("default")
    shown = "" if default in (None, [], "") else f", default {example_of({'default': default, 'type': about['type']})}"
    return f"{about['help']} ({facts(about)}{shown})".replace("%", "%%")
