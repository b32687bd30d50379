"""What a test sets of its application's variables.

``application-variable``: only those that are not DoDo's, to values that fit. ``application-secret``: no secrets.
"""

from collections.abc import Iterator

from dodo_dsl.application.access import secret_problems
from dodo_dsl.application.test_variables import owner, split_by
from dodo_dsl.check.context import RuleContext
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Scalar

_RULE = "application-variable"


def check(context: RuleContext) -> Iterator[Diagnostic]:
    for name, entry in context.spec.variables.items():
        if why := owner(name):
            message = f"a test cannot set '{name}': {why}"
            yield Diagnostic(entry.key, _RULE, message, "set a variable that the application itself reads")
        elif isinstance(entry.value, Scalar):
            yield from _value(context, name, entry.value)
            yield from secret_problems.written([entry.value])


def _value(context: RuleContext, name: str, value: Scalar) -> Iterator[Diagnostic]:
    if not value.text.isprintable():
        yield Diagnostic(value.span, _RULE, f"the value of '{name}' has control characters, expected one line of text")
    elif context.application and (service := split_by(context.application, name, value.text)):
        message = f"the value of '{name}' has quotation marks or the like, at which the command of '{service}' is split"
        yield Diagnostic(value.span, _RULE, message, f"write the command of '{service}' as a list")
