"""What a service prints and becomes messages: ``x-dodo: {lines: [{match: ..., message: ..., sender: 0}]}``.

Patterns are RE2's, so that the time that a line takes grows only with its length. The library is loaded where
patterns are.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from dodo_dsl.application.model import PrintedLine
from dodo_dsl.diagnostics import Diagnostic, did_you_mean
from dodo_dsl.opendlv.odvd import SCALARS, Definition

LINES_RULE = "application-lines"
SAMPLE_TIME = "sample_time"
"""The group that is a message's sample time, and no field."""
_SYNTAX = "patterns are those of RE2, https://github.com/google/re2/wiki/Syntax"
_MAX_MEMORY = 8 << 20
_MAX_SIZE = 1000
"""Instructions of a pattern, by which the time of a line grows, too; a usual one has less than a hundred."""


class PatternError(ValueError):
    """A pattern that RE2 cannot use; the text says why."""


def compiled(pattern: str) -> Any:
    """The pattern for lines of bytes; raises PatternError."""
    import re2

    options = re2.Options()
    options.log_errors, options.max_mem = False, _MAX_MEMORY
    try:
        found = re2.compile(pattern.encode(), options)
    except re2.error as error:
        text = error.args[0] if error.args else ""
        raise PatternError(text.decode(errors="replace") if isinstance(text, bytes) else str(text)) from None
    except UnicodeEncodeError:
        raise PatternError("it is not UTF-8 text") from None
    if found.programsize > _MAX_SIZE:
        raise PatternError(f"it is as large as {found.programsize} instructions of RE2, expected at most {_MAX_SIZE}")
    return found


def line_problems(line: PrintedLine, known: Mapping[str, Definition]) -> Iterator[Diagnostic]:
    """What is wrong with a pattern and its groups; ``known`` are the messages, an unknown one is another rule's."""
    name, slash, stamp = line.message.partition("/")
    if slash:
        hint = f"write 'message: {name}' and 'sender: {stamp}'"
        yield Diagnostic(line.message_span, LINES_RULE, f"'{line.message[:80]}' is a message with a stamp", hint)
        return
    if name.startswith(("dodo.", "cluon.")):
        message = f"{name} is not the application's to send"
        yield Diagnostic(line.message_span, LINES_RULE, message, "name a message of OpenDLV's, or one of your own")
        return
    try:
        pattern = compiled(line.match)
    except PatternError as error:
        yield Diagnostic(line.match_span, LINES_RULE, f"the pattern cannot be read: {error}", _SYNTAX)
        return
    groups = [group.decode(errors="replace") for group in pattern.groupindex]
    if not pattern.groups:
        hint = "name each part of the line that is a field, for example (?P<groundSteering>[-+.0-9eE]+)"
        yield Diagnostic(line.match_span, LINES_RULE, "the pattern has no group, so that no field gets a value", hint)
    elif pattern.groups > len(groups):
        message = "the pattern has a group that no field alone takes"
        yield Diagnostic(line.match_span, LINES_RULE, message, "name each once, as in (?P<field>...), or write (?:...)")
    if name in known:
        yield from _unknown_fields(line, groups, known[name])


def _unknown_fields(line: PrintedLine, groups: list[str], definition: Definition) -> Iterator[Diagnostic]:
    types = {field.name: field.type for field in definition.fields}
    for group in groups:
        if group != SAMPLE_TIME and group not in types:
            message = f"{definition.name} has no field '{group[:80]}'"
            fields = ", ".join([*types, SAMPLE_TIME])
            hint = did_you_mean(group, [*types, SAMPLE_TIME]) or f"groups of the pattern may be {fields}"
            hint = "write 'sender: 0' next to 'match' for a sender stamp" if group == "sender" else hint
            yield Diagnostic(line.match_span, LINES_RULE, message, hint)
        elif group in types and types[group] not in SCALARS:
            message = f"field '{group}' of {definition.name} is a message itself, which a line cannot give"
            yield Diagnostic(line.match_span, LINES_RULE, message, "leave that group out")
