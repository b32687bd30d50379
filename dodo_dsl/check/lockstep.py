"""Lockstep, derived from a test's wiring: the rate of its steps, and the messages that answer a frame."""

from collections.abc import Iterable, Mapping
from decimal import Decimal

from dodo_dsl.check.wiring import ANYTHING, End, Wiring
from dodo_dsl.spec.arguments import ResolvedService
from dodo_dsl.spec.model import VIRTUAL

DEFAULT_HZ = 10.0
DETECTIONS = "opendlv.logic.perception.Detection"
"""Prefix of messages that a frame may have any number of, so that they cannot complete an answer."""

_CLOSE = Decimal("1e-6")


def cameras_of(wiring: Wiring) -> set[str]:
    """The services that produce frames."""
    return {end.service for end in wiring.produced if end.port.kind == "memory"}


def rates(services: Iterable[ResolvedService]) -> dict[str, float]:
    """The rates in Hz of the services that have one, by name in the test."""
    found = {}
    for service in services:
        text = service.texts.get("freq")
        if text is not None and service.manifest.parameters["freq"].unit == "Hz":
            found[service.use.name] = float(text)
    return found


def step_hz(wiring: Wiring, rates: Mapping[str, float], clock: str = "lockstep") -> float:
    """Steps per second: the rate of the fastest camera; ``rates`` are the services' in Hz.

    Where the application's own time is the test's, without a camera that of the fastest service that it hears.
    """
    sources = cameras_of(wiring)
    if clock == VIRTUAL and not sources:
        sources = {
            e.service for e in wiring.produced if any(i.port.consumes(e.port) for i in wiring.application_consumes)
        }
    return max((rates[name] for name in sources if name in rates), default=DEFAULT_HZ)


def rates_fit(rate: float, step: float) -> bool:
    """Whether a rate is a whole multiple or a whole fraction of the steps', both in Hz."""
    high, low = (Decimal(str(limit(rate, step))) for limit in (max, min))
    times = high / low
    return abs(times - round(times)) < _CLOSE


def answers(wiring: Wiring) -> list[str]:
    """The messages that answer a frame, each once: those that the application declares, else those that drive the
    vehicle, else those that are judged, and what it prints; empty without any."""
    expected = _expected(wiring)
    driven = [end for end in expected if end.layer == "action"]
    judged = [e for e in expected if e.layer == "evaluation" and not e.port.name.startswith(DETECTIONS)]
    chosen = driven or judged
    printed = [end for end in wiring.printed if not end.port.name.startswith(DETECTIONS)]
    missing = [end for end in printed if not any(each.port.consumes(end.port) for each in chosen)]
    return _names(wiring.answers) or _names([*chosen, *missing])


def driving(wiring: Wiring) -> list[str]:
    """The messages of the application that drive the vehicle, each once."""
    return _names(end for end in _expected(wiring) if end.layer == "action")


def _expected(wiring: Wiring) -> list[End]:
    return [end for end in _from_application(wiring) if _is_expected(end, wiring)]


def other_inputs(wiring: Wiring) -> list[str]:
    """Other messages of the application that services of the test consume."""
    chosen = answers(wiring)
    return [name for name in _names(_from_application(wiring)) if name not in chosen]


def all_inputs(wiring: Wiring) -> list[str]:
    """All messages of the application that services of the test consume."""
    return _names(_from_application(wiring))


def _from_application(wiring: Wiring) -> list[End]:
    """The inputs of services that only the application can feed."""
    return [
        end
        for end in wiring.consumed
        if end.port.kind == "message"
        and end.port.name != ANYTHING
        and end.port.can_be_required
        and not wiring.is_truth(end.port)
        and not any(end.port.consumes(other.port) for other in wiring.produced if other.port.name != ANYTHING)
    ]


def _is_expected(end: End, wiring: Wiring) -> bool:
    """Whether the application has to produce it: an optional message only when it declares that it does."""
    return not end.port.optional or any(end.port.consumes(other.port) for other in wiring.application_produces)


def _names(ends: Iterable[End]) -> list[str]:
    """The messages by name, each once; a name alone means all its sender stamps."""
    ports = {end.port for end in ends}
    anybody = {port.name for port in ports if port.stamp is None}
    return sorted({str(port) for port in ports if port.stamp is None or port.name not in anybody})
