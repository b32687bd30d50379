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
    name, slash, stamp = line.message.partition("/")
    if slash or name.startswith(("dodo.", "cluon.")):
        message = f"'{line.message[:80]}' is not the name of a message that an application sends"
        hint = f"write 'message: {name}' and 'sender: {stamp}'" if slash else ""
        yield Diagnostic(line.message_span, LINES_RULE, message, hint)
        return
    try:
        pattern = compiled(line.match)
    except PatternError as error:
        yield Diagnostic(line.match_span, LINES_RULE, f"the pattern cannot be read: {error}", _SYNTAX)
        return
    groups = [group.decode(errors="replace") for group in pattern.groupindex]
    if not groups or pattern.groups > len(groups):
        message = "each group of the pattern needs the name of a field, and one is needed"
        hint = "name them, for example (?P<groundSteering>[-+.0-9eE]+), or write (?:...)"
        yield Diagnostic(line.match_span, LINES_RULE, message, hint)
    fields = [field.name for field in known[name].fields if field.type in SCALARS] if name in known else groups
    for group in groups:
        if group not in (*fields, SAMPLE_TIME):
            message = f"{name} has no field '{group[:80]}' with one value"
            hint = did_you_mean(group, [*fields, SAMPLE_TIME])
            hint = "write 'sender: 0' next to 'match' for a sender stamp" if group == "sender" else hint
            yield Diagnostic(line.match_span, LINES_RULE, message, hint)
