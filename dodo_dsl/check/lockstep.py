"""What the wiring of a test says about lockstep: how fast it steps, and what answers a frame."""

from collections.abc import Iterable, Mapping
from decimal import Decimal

from dodo_dsl.check.context import Context
from dodo_dsl.check.wiring import ANYTHING, End, Wiring
from dodo_dsl.spec import arguments

DEFAULT_HZ = 10.0
DETECTIONS = "opendlv.logic.perception.Detection"
"""Messages of which any number belongs to a frame, also none: they answer nothing."""

_CLOSE = Decimal("1e-6")


def cameras_of(wiring: Wiring) -> set[str]:
    """The services that make pictures."""
    return {end.service for end in wiring.said if end.port.kind == "memory"}


def rates(context: Context) -> dict[str, float]:
    """The rates in Hz of the services that have one, by name in the test."""
    found = {}
    for use, manifest in context.known_uses():
        text = arguments.texts(context.spec, use, manifest, context.rig).get("freq")
        if text is not None and manifest.parameters["freq"].unit == "Hz":
            found[use.name] = float(text)
    return found


def step_hz(wiring: Wiring, rates: Mapping[str, float]) -> float:
    """Steps per second: the rate of the fastest camera; ``rates`` are the services' in Hz."""
    return max((rates[name] for name in cameras_of(wiring) if name in rates), default=DEFAULT_HZ)


def rates_fit(rate: float, step: float) -> bool:
    """Whether a rate is a whole multiple or a whole fraction of the steps', both in Hz."""
    high, low = (Decimal(str(limit(rate, step))) for limit in (max, min))
    times = high / low
    return abs(times - round(times)) < _CLOSE


def answers(wiring: Wiring) -> list[str]:
    """The messages that answer a frame, each once: what the application declares, else what drives the vehicle, else
    what is judged, else its own word that a frame is done. Empty where nothing of this is known."""
    declared = _names(wiring.answers)
    driving = _names(end for end in _asked(wiring) if end.layer == "action" and _is_due(end, wiring))
    judging = [end for end in _asked(wiring) if end.layer == "evaluation" and not end.port.name.startswith(DETECTIONS)]
    return declared or driving or _names(end for end in judging if _is_due(end, wiring))


def heard(wiring: Wiring) -> list[str]:
    """Other messages of the application that services of the test listen to."""
    chosen = answers(wiring)
    return [name for name in _names(_asked(wiring)) if name not in chosen]


def _asked(wiring: Wiring) -> list[End]:
    """What services hear from the application, as far as they do not hear it from one another."""
    return [
        end
        for end in wiring.heard
        if end.port.kind == "message"
        and end.port.name != ANYTHING
        and end.port.may_be_asked
        and not any(end.port.hears(other.port) for other in wiring.said if other.port.name != ANYTHING)
    ]


def _is_due(end: End, wiring: Wiring) -> bool:
    """Whether the application has to say it: what is optional only when it declares that it does."""
    return not end.port.optional or any(end.port.hears(other.port) for other in wiring.application_says)


def _names(ends: Iterable[End]) -> list[str]:
    """The messages by name, each once; where any sender counts, no other is named."""
    ports = {end.port for end in ends}
    anybody = {port.name for port in ports if port.stamp is None}
    return sorted({str(port) for port in ports if port.stamp is None or port.name not in anybody})
