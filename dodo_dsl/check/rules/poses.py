"""``true-pose``: the application takes what only a simulation knows, and the test hides that."""

from collections.abc import Iterator

from dodo_dsl.check.context import RuleContext
from dodo_dsl.check.world import HIDDEN, told
from dodo_dsl.diagnostics import Diagnostic


def check(context: RuleContext) -> Iterator[Diagnostic]:
    if context.spec.pose != HIDDEN:
        return
    name = context.spec.name or context.spec.location.stem
    for end in told(context.wiring):
        message = f"the application's '{end.service}' takes {end.port}, which only a simulation has: '{name}' hides it"
        hint = "take it out of x-dodo.in, or write 'pose: declared' in a test of your own"
        yield Diagnostic(end.span, "true-pose", message, hint)
