"""``level-kind``: recorded data cannot react, so no closed loop at level dil (thesis, Table 4.3).

``clock-level``: lockstep needs an environment that can wait, so hardware runs in real time.
"""

from collections.abc import Iterator

from dodo_dsl.check.context import RuleContext
from dodo_dsl.diagnostics import Diagnostic


def check(context: RuleContext) -> Iterator[Diagnostic]:
    spec = context.spec
    if spec.level == "dil" and spec.kind == "closed-loop":
        message = "a dil test cannot be closed-loop: a recording does not react to what the application does"
        yield Diagnostic(
            spec.span("kind"), "level-kind", message, "use kind open-loop or perception, or level sil or hil"
        )
    if spec.level == "hil" and spec.clock == "lockstep":
        message = "a hil test cannot run in lockstep: hardware does not wait"
        yield Diagnostic(spec.span("clock"), "clock-level", message, "use clock realtime")
