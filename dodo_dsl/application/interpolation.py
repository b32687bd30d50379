"""Variables in compose files, ``${NAME:-default}``: found, and filled in as compose does; and ``.env`` files."""

import itertools
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_VARIABLE_NAME = re.compile(rf"\$\$|\$\{{?({_NAME.pattern})")
_BARE_NAME = re.compile(rf"\$\$|\$\{{({_NAME.pattern})\}}|\$({_NAME.pattern})")
_SHOWN = 60
_BLANKS = r"[ \t\v\f\r\x85\xa0]*"
_SKIPPED = re.compile(r"(?:\s|#[^\n]*)*")
_NAMED = re.compile(rf"(?:export\s+)?(?P<name>(?:[\w.\[\]-]|{_BLANKS[:-1]})*)(?P<sign>[=:\n]|\Z){_BLANKS}")
_RAW_NAME = re.compile(r"(?P<name>[^=\n]*)(?P<sign>=|\Z|(?=\n))")
_QUOTED = re.compile(r"""(?P<quote>["'])(?P<body>(?:\\.|(?!(?P=quote))[^\\])*)(?P=quote)""", re.DOTALL)
_ESCAPE = re.compile(r'\\(?:[abfnrtv$"\\]|0(?P<octal>\d{0,3}))', re.ASCII)
VARIABLE = re.compile(
    r"\$(?:(?P<escaped>\$)|(?P<bare>[A-Za-z_][A-Za-z0-9_]*)"
    r"|\{(?P<name>[A-Za-z_][A-Za-z0-9_]*)(?:(?P<colon>:?)(?P<operator>[-?+])(?P<word>.*))?\})"
)
_ESCAPES = {"a": "\a", "b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t", "v": "\v", "$": "$$"}


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
    hidden = _replaced(text, lambda match: " " * len(match[0]))
    places = [-1, *(place for place, character in enumerate(hidden) if character == sign), len(text)]
    return [text[start + 1 : end] for start, end in itertools.pairwise(places)]


def names(text: str) -> set[str]:
    return {match[1] for match in _VARIABLE_NAME.finditer(text) if match[1]}


def without_default(text: str) -> set[str]:
    return {match[1] or match[2] for match in _BARE_NAME.finditer(text) if match[0] != "$$"}


class EnvironmentProblem(ValueError):
    """A required variable (``${NAME:?why}``) is not set, or a user has no home folder."""


class RequiredVariable(EnvironmentProblem):
    def __init__(self, name: str, why: str) -> None:
        self.name, self.why = name, why or "it is required"
        super().__init__(f"variable {name} is not set: {self.why}")


def _never(_name: str) -> bool:
    return False


def filled(text: str, known: Mapping[str, str], late: Callable[[str], bool] = _never) -> str:
    """The text as a compiled file has it: with variables filled in, but for ``late`` ones, and ``$$`` for a dollar.

    ``$NAME``, ``${NAME}``, ``${NAME:-default}``, ``${NAME:?error}`` and ``${NAME:+other}`` are as in compose; defaults
    may hold variables. Those that are not ``known`` are empty; one that is required stays, to be reported.
    """
    return _replaced(text, lambda match: _value_of(match, known, late)) if "$" in text else text


def _replaced(text: str, change: Callable[[re.Match[str]], str]) -> str:
    parts, place = [], 0
    while (dollar := text.find("$", place)) >= 0:
        end = end_of_variable(text, dollar)
        match = VARIABLE.fullmatch(text, dollar, end)
        parts += [text[place:dollar], change(match) if match else text[dollar:end]]
        place = end
    return "".join([*parts, text[place:]])


def _value_of(match: re.Match[str], known: Mapping[str, str], late: Callable[[str], bool]) -> str:
    name, word = match["bare"] or match["name"] or "", match["word"]
    if match["escaped"] or late(name):
        start, end = match.start(), match.start("word")
        return match[0] if word is None else f"{match.string[start:end]}{filled(word, known, late)}}}"
    value = known.get(name)
    present = bool(value) if match["colon"] else value is not None
    if match["operator"] == "+":
        return filled(word, known, late) if present else ""
    if present or not match["operator"]:
        return (value or "").replace("$", "$$")
    return match[0] if match["operator"] == "?" else filled(word, known, late)


def literal(text: str) -> str | None:
    """A filled text as compose reads it; None if it still has a variable."""
    if "$" not in text:
        return text
    try:
        return interpolate(text)
    except RequiredVariable:
        return None


def interpolate(text: str, known: Mapping[str, str] | None = None) -> str:
    """The text as compose reads it, with variables filled in if they are ``known``; raises RequiredVariable."""

    def read(match: re.Match[str]) -> str:
        if match["escaped"]:
            return "$"
        raise RequiredVariable(match["bare"] or match["name"], match["word"] or "")

    return _replaced(text if known is None else filled(text, known), read)


def slip_in(text: str) -> tuple[str, str] | None:
    """What is wrong with the first such variable, and a hint; defaults are looked at, too."""
    place = text.find("$")
    while place >= 0:
        end = end_of_variable(text, place)
        match = VARIABLE.fullmatch(text, place, end)
        if match is None and text[place + 1 : place + 2] == "{":
            return _slip(text[place:end])
        if match and (inner := slip_in(match["word"] or "")):
            return inner
        place = text.find("$", end)
    return None


def _slip(written: str) -> tuple[str, str]:
    what = "write ${NAME:-default}, closed, with letters, digits and underscores in the name"
    return f"'{written[:_SHOWN]}' is not a variable of compose", f"{what}; text that begins with ${{ is written $${{"


class DotenvProblem(EnvironmentProblem):
    def __init__(self, text: str, place: int, what: str, hint: str) -> None:
        self.line, self.what, self.hint = text.count("\n", 0, place) + 1, what, hint
        super().__init__(f"line {self.line}: {what}; {hint}")


def dotenv(text: str, *, raw: bool = False) -> tuple[list[tuple[str, str | None]], DotenvProblem | None]:
    """The variables of a ``.env`` file as compose reads it, up to the first problem; a literal ``$`` is doubled.

    None takes the value from outside. ``raw`` is the format in which values are as they are written.
    """
    found: list[tuple[str, str | None]] = []
    try:
        found.extend(_statements(text, raw))
    except DotenvProblem as problem:
        return found, problem
    return found, None


def dotenv_file(
    path: Path, known: Mapping[str, str], before: Mapping[str, str] | None = None, *, raw: bool = False
) -> dict[str, str]:
    """The variables of a ``.env`` file, interpolated with ``known`` first, then with earlier ones and those ``before``.

    Empty without a file; raises EnvironmentProblem for what compose refuses.
    """
    written, problem = dotenv(path.read_bytes().decode(errors="replace") if path.is_file() else "", raw=raw)
    if problem:
        raise EnvironmentProblem(f"'{path.name}', {problem}")
    found: dict[str, str] = {}
    for name, value in written:
        if value is not None or name in known:
            found[name] = known[name] if value is None else interpolate(value, {**(before or {}), **found, **known})
    return found


def _statements(text: str, raw: bool) -> Iterator[tuple[str, str | None]]:
    """The variables with their values; raises DotenvProblem."""
    text, place = text.removeprefix("\ufeff"), 0
    while (place := _SKIPPED.match(text, place).end()) < len(text):  # type: ignore[union-attr]
        match = (_RAW_NAME if raw else _NAMED).match(text, place)
        name = match["name"].rstrip("\r" if raw else None) if match else ""
        if not match or not name or any(character.isspace() for character in name):
            raise DotenvProblem(text, place, "a variable has no name", "write NAME=value, one on each line")
        if not match["sign"] and not raw:
            raise DotenvProblem(text, place, f"'{name}' has no value, and no line break behind it", f"write {name}=")
        value, place = None, match.end()
        if match["sign"] in ("=", ":"):
            value, place = _value(text, place, raw)
        yield name, value


def _value(text: str, start: int, raw: bool) -> tuple[str, int]:
    """A value, and where it ends; raises DotenvProblem."""
    quoted = None if raw else _QUOTED.match(text, start)
    end = quoted.end() if quoted else (text.find("\n", start) + 1 or len(text) + 1) - 1
    value = quoted["body"] if quoted else text[start:end]
    if "\ufffd" in value:
        raise DotenvProblem(text, start, "the value is not UTF-8 text", "save the file as UTF-8")
    if raw:
        return value.removesuffix("\r").replace("$", "$$"), end
    if quoted and quoted["quote"] == "'":
        return value.replace("\\'", "'").replace("$", "$$"), end
    if value.startswith(("'", '"')) and not quoted:
        raise DotenvProblem(text, start, f"the quotation mark {value[0]} is not closed", "close it behind the value")
    value = _ESCAPE.sub(_unescaped, value) if quoted else value.partition(" #")[0].rstrip()
    if slip := slip_in(value):
        raise DotenvProblem(text, start, *slip)
    return value, end


def _unescaped(match: re.Match[str]) -> str:
    octal = match["octal"]
    if octal is None:
        return _ESCAPES.get(match[0][1], match[0][1])
    return chr(int(octal, 8)) if re.fullmatch("[0-3][0-7]{2}", octal) else f"\\{octal}"


def escaped(text: str) -> str:
    """A path as a compose file has it, in which a dollar sign alone begins a variable."""
    return text.replace("$", "$$")


def mapped_texts(value: Any, change: Callable[[str], str]) -> Any:
    if isinstance(value, dict):
        return {key: mapped_texts(each, change) for key, each in value.items()}
    if isinstance(value, list):
        return [mapped_texts(each, change) for each in value]
    return change(value) if isinstance(value, str) else value
