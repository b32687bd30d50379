"""``unknown-check``: a goal names a check of an evaluator. ``goal-values``: its values fit its direction.

A goal that scores nothing, or the wrong way, would rank applications by mistake.
"""

from collections.abc import Iterator

from dodo_dsl.check.context import RuleContext
from dodo_dsl.check.goals import resolved_goals
from dodo_dsl.diagnostics import Diagnostic


def check(context: RuleContext) -> Iterator[Diagnostic]:
    yield from resolved_goals(context.test).problems
