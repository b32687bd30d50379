"""Variables in compose files, ``${NAME:-default}``: found, and filled in as compose does; and ``.env`` files."""

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dodo_dsl.application.access import secret_variables

if TYPE_CHECKING:
    from dodo_dsl.source import Node

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_LINE = re.compile(r"\s*(?:export\s+)?(?P<name>[A-Za-z_][A-Za-z0-9_.-]*)[ \t]*[=:][ \t]*")
VARIABLE = re.compile(
    r"\$(?:(?P<escaped>\$)|(?P<bare>[A-Za-z_][A-Za-z0-9_]*)"
    r"|\{(?P<name>[A-Za-z_][A-Za-z0-9_]*)(?:(?P<colon>:?)(?P<operator>[-?+])(?P<word>.*))?\})",
    re.DOTALL,
)
_ESCAPES = {"n": "\n", "r": "\r", "t": "\t", "$": "$$"}


def end_of_variable(text: str, start: int) -> int:
    """Where the variable that begins at the ``$`` of ``start`` ends; braces nest, ``$$`` is not a variable."""
    if text[start + 1 : start + 2] == "$":
        return start + 2
    if text[start + 1 : start + 2] != "{":
        match = _NAME.match(text, start + 1)
        return match.end() if match else start + 1
    depth = 0
    for place in range(start + 1, len(text)):
        depth += {"{": 1, "}": -1}.get(text[place], 0)
        if depth == 0:
            return place + 1
    return len(text)


def split_outside(text: str, sign: str) -> list[str]:
    """A string split at a sign, but not within variables: ``${A:-b:c}:d`` has two parts at the colons."""
    parts, begin, place = [], 0, 0
    while place < len(text):
        if text[place] == "$":
            place = end_of_variable(text, place)
            continue
        if text[place] == sign:
            parts.append(text[begin:place])
            begin = place + 1
        place += 1
    return [*parts, text[begin:]]


def names(text: str) -> set[str]:
    """The variables in a string, those in defaults included."""
    found: set[str] = set()
    place = text.find("$")
    while place >= 0:
        match = _NAME.match(text, place + 1 + (text[place + 1 : place + 2] == "{"))
        if match:
            found.add(match[0])
        escaped = text[place + 1 : place + 2] == "$"
        place = text.find("$", place + (2 if escaped else 1))
    return found


class EnvironmentProblem(ValueError):
    """A required variable (``${NAME:?why}``) is not set, or a user has no home folder."""


class RequiredVariable(EnvironmentProblem):
    """The required variable ``name``, and ``why`` its file requires it."""

    def __init__(self, name: str, why: str) -> None:
        self.name, self.why = name, why or "it is required"
        super().__init__(f"variable {name} is not set: {self.why}")


def interpolate(text: str, known: Mapping[str, str], *, unset: bool = True) -> str:
    """``$NAME``, ``${NAME}``, ``${NAME:-default}``, ``${NAME:?error}``, ``${NAME:+other}`` and ``$$`` as in compose.

    Defaults may hold variables in turn. Without ``unset``, a variable that is neither known nor has a default raises
    EnvironmentProblem instead of being empty.
    """
    return _replaced(text, lambda match: _filled(match, known, unset))


def _replaced(text: str, change: Callable[[re.Match[str]], str]) -> str:
    """The text with ``change`` applied to each of its variables."""
    parts, place = [], 0
    while (dollar := text.find("$", place)) >= 0:
        end = end_of_variable(text, dollar)
        match = VARIABLE.fullmatch(text, dollar, end)
        parts += [text[place:dollar], change(match) if match else text[dollar:end]]
        place = end
    return "".join([*parts, text[place:]])


def _filled(match: re.Match[str], known: Mapping[str, str], unset: bool) -> str:
    if match["escaped"]:
        return "$"
    name = match["bare"] or match["name"]
    found, word = known.get(name), match["word"] or ""
    present = bool(found) if match["colon"] else found is not None
    if match["operator"] == "+":
        return interpolate(word, known, unset=unset) if present else ""
    if present:
        return found or ""
    if match["operator"] == "?":
        raise RequiredVariable(name, word)
    if match["operator"] == "-":
        return interpolate(word, known, unset=unset)
    if found is None and not unset:
        raise EnvironmentProblem(f"variable {name} is not set")
    return found or ""


def with_values(text: str, values: Mapping[str, str]) -> str:
    """The text with the variables of ``values`` filled in, and all others left for compose."""
    return _replaced(text, lambda match: _with_value(match, values))


def _with_value(match: re.Match[str], values: Mapping[str, str]) -> str:
    value, word = values.get(match["bare"] or match["name"] or ""), match["word"]
    if value is None:
        inner = match.span("word")
        return (
            match[0] if word is None else f"${match.string[match.start() + 1 : inner[0]]}{with_values(word, values)}}}"
        )
    present = bool(value) or not match["colon"]
    if match["operator"] == "+":
        return with_values(word, values) if present else ""
    if present:
        return value.replace("$", "$$")
    return match[0] if match["operator"] == "?" else with_values(word, values)


def known_variables(
    own: Mapping[str, str], outside: Mapping[str, str], folder: str, passed: Collection[str] = ()
) -> dict[str, str]:
    """The variables that compose would fill in: those ``outside`` first, then those of the application's ``.env``."""
    found: dict[str, str] = {}
    seen = {**secret_variables.allowed(outside, passed), "PWD": folder}
    for name, value in own.items():
        found[name] = interpolated(value, {**found, **seen})
    return {**found, **seen}


def interpolated(written: Any, known: Mapping[str, str]) -> Any:
    """A plain value with the variables of its texts filled in.

    A text stays as it is where one of them is neither known nor has a default.
    """
    if isinstance(written, dict):
        return {key: interpolated(below, known) for key, below in written.items()}
    if isinstance(written, list):
        return [interpolated(item, known) for item in written]
    if not isinstance(written, str) or "$" not in written:
        return written
    try:
        return interpolate(written, known, unset=False)
    except EnvironmentProblem:
        return written


def interpolated_node(written: "Node", known: Mapping[str, str]) -> "Node":
    """The same for a node; every part keeps its place."""
    return changed_node(written, lambda word: interpolated(word, known))


def changed_node(written: "Node", change: Callable[[str], str]) -> "Node":
    """A node with ``change`` applied to each text that has a variable; every part keeps its place."""
    from dodo_dsl import source  # which programs that only read variables do not load

    if isinstance(written, source.Mapping):
        entries = {
            key: source.Entry(entry.key, changed_node(entry.value, change)) for key, entry in written.entries.items()
        }
        return replace(written, entries=entries)
    if isinstance(written, source.Sequence):
        return replace(written, items=tuple(changed_node(item, change) for item in written.items))
    if not isinstance(written.value, str) or "$" not in written.value:
        return written
    filled = change(written.value)
    return replace(written, value=filled, text=filled)


def dotenv(text: str) -> dict[str, str]:
    """The variables of a ``.env`` file as compose reads it; a literal ``$`` is doubled.

    Names without a value, and lines that cannot be read, are skipped.
    """
    found, place = {}, 0
    while place < len(text):
        line_end = _or_end(text, text.find("\n", place))
        match = _LINE.match(text, place, line_end)
        if match is None or text[place:line_end].lstrip().startswith("#"):
            place = line_end + 1
            continue
        found[match["name"]], place = _value(text, match.end(), line_end)
    return found


def own_dotenv(folder: Path, known: Mapping[str, str]) -> dict[str, str]:
    """The variables of the ``.env`` in a folder as compose would read it; a symbolic link is not followed."""
    path = folder / ".env"
    return {} if path.is_symlink() else dotenv_file(path, known)


def dotenv_file(path: Path, known: Mapping[str, str]) -> dict[str, str]:
    """The variables of a ``.env`` file, interpolated with earlier ones and ``known``; none without a file."""
    if not path.is_file():
        return {}
    found: dict[str, str] = {}
    for name, value in dotenv(path.read_text(encoding="utf-8", errors="replace")).items():
        found[name] = interpolate(value, {**found, **known})
    return found


def _or_end(text: str, place: int) -> int:
    return len(text) if place < 0 else place


def _value(text: str, start: int, line_end: int) -> tuple[str, int]:
    """A value, and the position where the next line begins."""
    quote = text[start : start + 1]
    if quote not in ("'", '"'):
        return re.split(r"(?:^|\s)#", text[start:line_end], maxsplit=1)[0].strip(), line_end + 1
    characters, place = [], start + 1
    while place < len(text) and text[place] != quote:
        step = _character(text, place, quote)
        characters.append(step[0])
        place += step[1]
    return "".join(characters), _or_end(text, text.find("\n", place)) + 1


def _character(text: str, place: int, quote: str) -> tuple[str, int]:
    """The character at a position inside quotes, and the number of characters that it is written with."""
    character, following = text[place], text[place + 1 : place + 2]
    if quote == "'":
        return ("'", 2) if text[place : place + 2] == "\\'" else ("$$" if character == "$" else character, 1)
    if character == "\\" and following in ('"', "\\", *_ESCAPES):
        return _ESCAPES.get(following, following), 2
    return character, 1


def dotenv_line(name: str, value: str) -> str:
    """``NAME="value"`` as ``dotenv`` reads it."""
    escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\r", "\\r")
    return f'{name}="{escaped}"'
