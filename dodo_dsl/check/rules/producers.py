"""Each message or memory that a service consumes has a producer in the test, or is required of the application.

``no-producer``, ``no-sample`` (the same for an evaluator, which could then never judge), ``two-producers`` of one
message and sender stamp or of one memory, ``application-input`` (the application consumes what no service produces),
``true-pose`` (it consumes what only a simulation knows, and the test hides that).
"""

from collections.abc import Collection, Iterator

from dodo_dsl.check.context import RuleContext
from dodo_dsl.check.wiring import ANYTHING, End, Wiring
from dodo_dsl.check.world import HIDDEN, told
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.spec.manifest import Manifest


def check(context: RuleContext) -> Iterator[Diagnostic]:
    fits = all(service.use.layer in service.manifest.layers for service in context.services)
    if not context.spec.is_whole or not context.test.is_complete or not fits:
        return  # unknown services and wrong layers come first
    wiring = context.wiring
    known = {*context.messages, ANYTHING}
    misspelt = any(_is_unknown(end, known) for end in wiring.application_produces)
    own_misspelt = any(_is_unknown(end, known) for end in wiring.produced)
    for end in wiring.consumed:
        if (misspelt and end.port.can_be_required) or (own_misspelt and end.port.kind == "message"):
            continue  # the misspelt one may be meant
        if _is_unknown(end, known):
            continue  # its name is reported itself
        if not (end.port.optional or wiring.application_may_produce(end.port) or wiring.producers(end.port)):
            yield _unsatisfied(context, wiring, end)
    yield from _twice(wiring)
    yield from _unsatisfied_application(wiring)


def check_hidden(context: RuleContext) -> Iterator[Diagnostic]:
    """``true-pose``: the application takes what only a simulation knows, and the test hides that."""
    if context.spec.pose != HIDDEN:
        return
    name = context.spec.name or context.spec.location.stem
    for end in told(context.wiring):
        message = f"the application's '{end.service}' takes {end.port}, which only a simulation has: '{name}' hides it"
        hint = "take it out of x-dodo.in, or write 'pose: declared' in a test of your own"
        yield Diagnostic(end.span, "true-pose", message, hint)


def _is_unknown(end: End, known: Collection[str]) -> bool:
    """Whether it is an unknown message, which is reported where it is written."""
    return end.port.kind == "message" and end.port.name not in known


def _unsatisfied(context: RuleContext, wiring: Wiring, end: End) -> Diagnostic:
    rule = "no-sample" if end.layer == "evaluation" else "no-producer"
    what = f"{end.port.kind} {end.port}" if end.port.kind == "memory" else str(end.port)
    if end.port.can_be_required:
        message = f"'{end.service}' needs {what}, which no service of the test or the application sends"
        hint = "list it under x-dodo.out of the application's service that sends it"
    else:
        message = f"'{end.service}' needs {what}, which no service of the test sends"
        hint = _who_could(context, wiring, end)
    if rule == "no-sample":
        message += ", so it could never judge"
    return Diagnostic(end.span, rule, message, hint)


def _who_could(context: RuleContext, wiring: Wiring, end: End) -> str:
    """A hint: another sender stamp that is sent, or services that send such messages."""
    stamps = sorted(str(e.port) for e in wiring.produced if e.port.name == end.port.name)
    if stamps:
        return f"the test sends {' and '.join(stamps)}"
    names = sorted(m.name for m in context.manifests.values() if _sends(m, end.port.name))
    return f"add a service that sends it: {', '.join(names)}" if names else ""


def _sends(manifest: Manifest, name: str) -> bool:
    return any(port.partition("/")[0] == name for port in manifest.messages.outputs)


def _twice(wiring: Wiring) -> Iterator[Diagnostic]:
    first: dict[tuple[str, str, int | None], End] = {}
    for end in (*wiring.produced, *wiring.application_produces):
        if end.port.name == ANYTHING:
            continue
        key = (end.port.kind, end.port.name, end.port.stamp)
        other = first.setdefault(key, end)
        if other is not end and "application" not in (other.layer,):
            who = f"the application's '{end.service}'" if end.layer == "application" else f"'{end.service}'"
            does, what = ("send", "sender stamp") if end.port.kind == "message" else ("write the memory", "name")
            message = f"'{other.service}' and {who} both {does} {end.port}"
            hint = f"give one of them another {what}"
            yield Diagnostic(end.span, "two-producers", message, hint)


def _unsatisfied_application(wiring: Wiring) -> Iterator[Diagnostic]:
    for end in wiring.application_consumes:
        own = any(end.port.consumes(other.port) for other in wiring.application_produces)
        if not own and not wiring.producers(end.port) and not wiring.undeclared:
            message = f"the application's '{end.service}' consumes {end.port}, which no service of the test sends"
            yield Diagnostic(end.span, "application-input", message, severity="warning")
