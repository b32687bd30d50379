"""``clock-rate``: in lockstep the test goes from picture to picture, so all rates have to fit the camera's.

``clock-answers``: in lockstep the test has to know when the application has answered a picture.
"""

from collections.abc import Iterator

from dodo_dsl.check.context import Context
from dodo_dsl.check.lockstep import answers, rates, rates_fit, step_hz
from dodo_dsl.check.wiring import Wiring, wire
from dodo_dsl.diagnostics import Diagnostic


def check(context: Context) -> Iterator[Diagnostic]:
    if context.spec.clock != "lockstep" or not context.spec.is_whole:
        return
    wiring = wire(context)
    yield from _rates(context, wiring)
    if wiring.has_application and not wiring.done and not answers(wiring):
        message = "nothing tells when the application has answered a picture: it counts as done when it waits again"
        hint = "list x-dodo.answers, or x-dodo.done, at the application's service that speaks last"
        yield Diagnostic(context.spec.span("clock"), "clock-answers", message, hint, severity="warning")


def _rates(context: Context, wiring: Wiring) -> Iterator[Diagnostic]:
    known = rates(context)
    step = step_hz(wiring, known)
    for use in context.spec.uses:
        rate = known.get(use.name)
        if rate is None or rates_fit(rate, step):
            continue
        written = use.parameters.get("freq")
        message = (
            f"'{use.name}' has {rate:g} Hz, no whole multiple or fraction of the {step:g} Hz of the test's pictures"
        )
        hint = (
            f"in lockstep the test goes on by {1000 / step:g} ms at a time; take for example {_near(rate, step):g} Hz"
        )
        yield Diagnostic(written.key if written else use.span, "clock-rate", message, hint)


def _near(rate: float, step: float) -> float:
    return step * round(rate / step) if rate > step else step / round(step / rate)
