"""Slips with signs that stand for others, or mean something else in YAML."""

import re
import unicodedata
from collections.abc import Iterator

from dodo_dsl.diagnostics import Fix
from dodo_dsl.slips.failure import Failure, Slip, shortened

_NO_COLON = re.compile(r" *(?:- )?(?P<key>[a-z][a-z0-9-]*)(?P<sign>[;\uff1a\ufe55\ufe13\u2236\ua789])(?P<value>.*)")
_PERCENT = re.compile(r"% ?(?P<number>\d+(?:\.\d+)?)(?=\s*(?:$|[]},#]))")
_REASONS = {"&": "begins an anchor", "*": "begins an alias", "!": "begins a tag", "%": "begins a directive"}


def other_colon(failure: Failure) -> Iterator[Slip]:
    """A semicolon, or a colon of other scripts, after a key."""
    number = failure.suspect
    found = _NO_COLON.fullmatch(line := failure.line(number))
    if not found or ": " in line:
        return
    sign, value = found["sign"], found["value"]
    name = "" if sign.isascii() else f", a {unicodedata.name(sign).lower()} (U+{ord(sign):04X}),"
    hint = f"write '{found['key']}: {shortened(value.strip())}'"
    fix = Fix(sign, ":" if value.startswith(" ") else ": ")
    message = f"'{sign}'{name} stands after '{found['key']}', expected a colon"
    yield Slip(number, found.start("sign"), message, hint, fix=fix)


def first_character(failure: Failure) -> Iterator[Slip]:
    """Characters that mean something else, or nothing, at the begin of a value."""
    is_name = failure.context.endswith(("anchor", "alias"))
    place = failure.begin if is_name and failure.begin else failure.mark
    rest = failure.line(place[0])[place[1] :]
    sign = rest[:1]
    if not sign or ("cannot start any token" not in failure.problem and sign not in "&*"):
        return
    why = f", which {_REASONS[sign]}" if sign in _REASONS else ""
    message = f"a text cannot begin with '{sign}'{why}"
    if share := _PERCENT.match(rest):
        new = f"{share['number']} %"
        yield Slip(*place, message, f"write '{new}'", fix=Fix(share[0], new), length=len(share[0]))
    else:
        yield Slip(*place, message, "write the text in quotes")
