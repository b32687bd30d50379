"""Environment variables of services under test, and compose's interpolation of them in commands."""

import os
import re
import sys
from collections.abc import Mapping
from pathlib import Path

from dodo_dsl.application import interpolation

_VARIABLE = re.compile(
    r"\$(?:(?P<escaped>\$)|(?P<bare>[A-Za-z_][A-Za-z0-9_]*)"
    r"|\{(?P<name>[A-Za-z_][A-Za-z0-9_]*)(?:(?P<colon>:?)(?P<operator>[-?+])(?P<word>.*))?\})",
    re.DOTALL,
)


class EnvironmentProblem(ValueError):
    """A required variable (``${NAME:?why}``) is not set, or a user has no home folder."""


def interpolate(text: str, known: Mapping[str, str]) -> str:
    """``$NAME``, ``${NAME}``, ``${NAME:-default}``, ``${NAME:?error}``, ``${NAME:+other}`` and ``$$`` as in compose.

    Defaults may hold variables in turn.
    """
    parts, place = [], 0
    while (dollar := text.find("$", place)) >= 0:
        end = interpolation.end_of_variable(text, dollar)
        match = _VARIABLE.fullmatch(text, dollar, end)
        parts += [text[place:dollar], _value(match, known) if match else text[dollar:end]]
        place = end
    return "".join([*parts, text[place:]])


def _value(match: re.Match[str], known: Mapping[str, str]) -> str:
    if match["escaped"]:
        return "$"
    name = match["bare"] or match["name"]
    found, word = known.get(name), match["word"] or ""
    present = bool(found) if match["colon"] else found is not None
    if match["operator"] == "+":
        return interpolate(word, known) if present else ""
    if present:
        return found or ""
    if match["operator"] == "?":
        raise EnvironmentProblem(f"variable {name} is not set: {word or 'it is required'}")
    return interpolate(word, known) if match["operator"] == "-" else found or ""


def dotenv(path: Path, known: Mapping[str, str]) -> dict[str, str]:
    """The variables of a ``.env`` file, interpolated with earlier ones and ``known``; empty when there is no file."""
    if not path.is_file():
        return {}
    found: dict[str, str] = {}
    for name, value in interpolation.dotenv(path.read_text(encoding="utf-8", errors="replace")).items():
        found[name] = interpolate(value, {**found, **known})
    return found


def base_environment() -> dict[str, str]:
    """DoDo's own environment, with the folder of its interpreter first in ``PATH`` and unbuffered Python."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    return {**os.environ, "PATH": path, "PYTHONUNBUFFERED": "1"}


def expanded(path: str) -> Path:
    """A path with ``~`` or ``~user`` replaced by a home folder; raises EnvironmentProblem."""
    try:
        return Path(path).expanduser()
    except RuntimeError:
        raise EnvironmentProblem(f"there is no home folder for '{path}'") from None
