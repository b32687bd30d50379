"""``clock-rate``: in lockstep a test steps from frame to frame, so all rates have to fit the camera's.

``clock-answers``: in lockstep a message has to complete the application's answer to a frame.
"""

from collections.abc import Iterator

from dodo_dsl.check.context import RuleContext
from dodo_dsl.check.lockstep import answers, rates, rates_fit, step_hz
from dodo_dsl.diagnostics import Diagnostic


def check(context: RuleContext) -> Iterator[Diagnostic]:
    if context.spec.clock != "lockstep" or not context.spec.is_whole:
        return
    wiring = context.wiring
    yield from _rates(context)
    if wiring.has_application and not wiring.done and not answers(wiring):
        message = "no declared message completes a frame: the application's answer ends when it waits for the next one"
        hint = "declare x-dodo.answers, or x-dodo.done, at the application's service that sends last"
        yield Diagnostic(context.spec.span("clock"), "clock-answers", message, hint, severity="warning")


def _rates(context: RuleContext) -> Iterator[Diagnostic]:
    known = rates(context.services)
    step = step_hz(context.wiring, known)
    for use in context.spec.uses:
        rate = known.get(use.name)
        if rate is None or rates_fit(rate, step):
            continue
        written = use.parameters.get("freq")
        message = (
            f"'{use.name}' has {rate:g} Hz, not a whole multiple or fraction of the {step:g} Hz of the test's frames"
        )
        hint = f"in lockstep a step takes {1000 / step:g} ms; use for example {_near(rate, step):g} Hz"
        yield Diagnostic(written.key if written else use.span, "clock-rate", message, hint)


def _near(rate: float, step: float) -> float:
    return step * round(rate / step) if rate > step else step / round(step / rate)
