"""Slips with values: texts that have a colon, or stand where a key is expected."""

import re
from collections.abc import Iterator

from dodo_dsl.diagnostics import Fix
from dodo_dsl.slips.failure import KEY, PLAIN_KEY, VALUES, Failure, Slip, indent, shortened

_OPEN = re.compile(r" *(?:- )?(?P<key>[A-Za-z_][\w.-]*):(?:\s+(?P<sign>[|>][-+\d]*))?\s*(?:#.*)?")
"""A key whose value is in the lines below."""
_ALIAS = re.compile(r"\s*(?P<alias>\*[\w.-]+)\s*(?:#.*)?")
_FEW_WORDS = 4


def not_indented(failure: Failure) -> Iterator[Slip]:
    """A value in a line of its own, which begins where its key does."""
    number = failure.suspect
    above = failure.above(number)
    found = _OPEN.fullmatch(failure.line(above)) if above >= 0 else None
    deep = indent(line := failure.line(number))
    if not found or deep > indent(failure.line(above)) or ": " in line or line.rstrip().endswith(":"):
        return
    if any(written.strip() for written in failure.text.splitlines()[above + 1 : number]):
        return  # the text of a block, or a comment
    if found["sign"] or indent(failure.below(number)) <= deep:
        message = f"this text begins in the column of '{found['key']}' above"
        yield Slip(number, deep, message, f"indent it: it is the value of '{found['key']}'")


def bare_alias(failure: Failure) -> Iterator[Slip]:
    """An alias among keys, which was meant to give more of them."""
    for number in (failure.suspect, failure.above(failure.mark[0]) if "expected key" in failure.problem else -1):
        if found := _ALIAS.fullmatch(failure.line(number)):
            alias = shortened(found["alias"])
            message = f"'{alias}' stands among keys, expected a key before it"
            yield Slip(number, found.start("alias"), message, f"write '<<: {alias}'", fix=Fix("*", "<<: *"))


def colon_further_down(failure: Failure) -> Iterator[Slip]:
    """A colon in a text of several lines, after the first one."""
    number = failure.mark[0]
    if VALUES not in failure.problem or ": " in failure.before or not failure.before.strip():
        return
    key, deep = None, indent(failure.line(number))
    while key is None and number > 0 and indent(failure.line(number := failure.above(number))) <= deep:
        key = KEY.fullmatch(failure.line(number))
    value = (key["value"] or "").strip() if key else ""
    if not key or indent(failure.line(number)) >= deep or not value or value[0] in "\"'[{|>&*!":
        return
    word = failure.before.strip()
    if " " in word or (" " in value and not PLAIN_KEY.fullmatch(word)):
        hint = f"put the text in quotes, or write '>' behind '{key['key']}:' and the text below"
        yield Slip(*failure.mark, f"a colon in the text of '{key['key']}', which goes on here", hint)


def colon_in_text(failure: Failure) -> Iterator[Slip]:
    if VALUES not in failure.problem or ": " not in failure.before:
        return
    key, _, rest = failure.before.strip().removeprefix("- ").partition(": ")
    value, words = f"{rest}{failure.here}".strip(), rest.split()
    hint = "write the text in quotes"
    if PLAIN_KEY.fullmatch(rest.strip()):
        hint = f"write a mapping in braces, '{key}: {{{shortened(value)}}}', or into the next lines"
    elif value.startswith("(") and value.endswith(")"):
        hint = f"write braces: '{key}: {{{shortened(value[1:-1])}}}'"
    elif 1 < len(words) <= _FEW_WORDS and PLAIN_KEY.fullmatch(words[-1]):
        hint = f"write '{words[-1]}{shortened(failure.here.rstrip())}' into a new line, or the text in quotes"
    yield Slip(*failure.mark, f"a second colon in the value of '{key}', which has to be one text", hint)
