"""Environment variables of services under test, and compose's interpolation of them in commands."""

import os
import re
import sys
from collections.abc import Mapping
from pathlib import Path

_VARIABLE = re.compile(
    r"\$(?:(?P<escaped>\$)|(?P<bare>[A-Za-z_][A-Za-z0-9_]*)"
    r"|\{(?P<name>[A-Za-z_][A-Za-z0-9_]*)(?:(?P<colon>:?)(?P<operator>[-?+])(?P<word>[^}]*))?\})"
)


class MissingVariable(ValueError):
    """A variable that must be set (``${NAME:?why}``) is not."""


def interpolate(text: str, variables: Mapping[str, str]) -> str:
    """``$NAME``, ``${NAME}``, ``${NAME:-default}``, ``${NAME:?error}``, ``${NAME:+other}`` and ``$$`` as in compose."""

    def value(match: re.Match[str]) -> str:
        if match["escaped"]:
            return "$"
        name = match["bare"] or match["name"]
        found = variables.get(name)
        present = bool(found) if match["colon"] else found is not None
        if match["operator"] == "+":
            return match["word"] if present else ""
        if present:
            return found or ""
        if match["operator"] == "?":
            raise MissingVariable(f"variable {name} is not set: {match['word'] or 'it is required'}")
        return match["word"] if match["operator"] == "-" else found or ""

    return _VARIABLE.sub(value, text)


def dotenv(path: Path) -> dict[str, str]:
    """The ``NAME=value`` lines of a ``.env`` file, quotes stripped; empty when there is none."""
    if not path.is_file():
        return {}
    found = {}
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        name, sign, value = line.strip().removeprefix("export ").partition("=")
        if sign and not name.startswith("#"):
            value = value.strip()
            quoted = len(value) > 1 and value[0] == value[-1] and value[0] in "'\""
            found[name.strip()] = value[1:-1] if quoted else value
    return found


def base_environment() -> dict[str, str]:
    """DoDo's own environment, with the folder of its interpreter first in ``PATH`` and unbuffered Python."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    return {**os.environ, "PATH": path, "PYTHONUNBUFFERED": "1"}
