"""Variables ``${NAME:-default}`` that compose refuses."""

import re
from collections.abc import Iterator

from dodo_dsl import source
from dodo_dsl.application.interpolation import VARIABLE, end_of_variable
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Scalar

_FILLED = ("services", "volumes", "networks", "secrets", "configs")
"""The top-level keys below which compose fills in variables."""
_WITHOUT_OPERATOR = re.compile(r"\$\{(?P<name>[A-Za-z_][A-Za-z0-9_]*):=?(?P<word>[^-?+}:=][^{}]*)\}")
_SHOWN = 60


def variable_problems(document: source.Mapping) -> Iterator[Diagnostic]:
    """Errors at the values of a compose file."""
    for key in _FILLED:
        node = document.get(key)
        for part in source.walk(node) if node else ():
            if isinstance(part, Scalar) and isinstance(part.value, str) and (slip := slip_in(part.value)):
                yield Diagnostic(part.span, "application-file", *slip)


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
    shown = written[:_SHOWN]
    if written.count("{") != written.count("}"):
        return "'${' is not closed", f"write '{written.split(maxsplit=1)[0][:_SHOWN]}}}'"
    if written == "${}":
        return "'${}' names no variable", "for example ${GAIN:-1}, or $${} for the text itself"
    known = _WITHOUT_OPERATOR.fullmatch(written)
    if known:
        return f"'{shown}' is no variable of compose", f"write '${{{known['name']}:-{known['word']}}}'"
    what = "the name of a variable has letters, digits and underscores"
    return f"'{shown}' is no variable of compose", f"{what}; text that begins with ${{ is written $${{"
