"""What the clock of a test in lockstep is told: who goes on when, and what answers a frame."""

from collections.abc import Mapping, Sequence

from dodo_dsl.check.wiring import ANYTHING, End, Wiring
from dodo_dsl.plan.model import Flag
from dodo_dsl.spec import quantity
from dodo_dsl.spec.model import Spec

CLOCK = "dodo-clock"
DEFAULT_HZ = 10.0

_WALL_FACTOR, _WALL_SPARE_S = 10.0, 60.0


def clock_flags(spec: Spec, wiring: Wiring, rates: Mapping[str, float], watch: Sequence[str]) -> tuple[Flag, ...]:
    """The clock's flags; ``rates`` are the services' in Hz, ``watch`` those that only look on."""
    action = _ordered([u.name for u in spec.uses if u.layer == "action"], wiring)
    sense = _ordered([u.name for u in spec.uses if u.layer == "environment"], wiring)
    cameras = cameras_of(wiring)
    sense.sort(key=lambda name: name in cameras)
    judges = [u.name for u in spec.uses if u.layer == "evaluation"]
    answers, heard = _asked(wiring)
    timeout = spec.timeout_s or 0.0
    values = {
        "freq": f"{step_hz(wiring, rates):g}",
        "advance": ",".join(action),
        "sense": ",".join(sense),
        "judge": ",".join(judges),
        "watch": ",".join(watch),
        "answers": ",".join(answers),
        "hears": ",".join(heard),
        "done": wiring.done,
        "timeout": f"{timeout:g}",
        "wall-timeout": f"{timeout * _WALL_FACTOR + _WALL_SPARE_S:g}",
    }
    return tuple(Flag(name, value) for name, value in values.items() if value)


def cameras_of(wiring: Wiring) -> set[str]:
    """The services that make pictures."""
    return {end.service for end in wiring.said if end.port.kind == "memory"}


def step_hz(wiring: Wiring, rates: Mapping[str, float]) -> float:
    """Steps per second: the rate of the fastest camera."""
    return max((rates[name] for name in cameras_of(wiring) if name in rates), default=DEFAULT_HZ)


def periods_fit(rate: float, step: float) -> bool:
    """Whether a rate is a whole multiple or a whole fraction of the steps', both in Hz."""
    high, low = max(rate, step), min(rate, step)
    times = quantity.Decimal(str(high)) / quantity.Decimal(str(low))
    return abs(times - round(times)) < quantity.Decimal("1e-9")


def _ordered(names: list[str], wiring: Wiring) -> list[str]:
    """Who speaks stands before who hears it; those that hear one another stay as they are written."""
    left, ordered = list(names), []
    while left:
        free = [name for name in left if not any(_feeds(other, name, wiring) for other in left if other != name)]
        chosen = (free or left)[0]
        left.remove(chosen)
        ordered.append(chosen)
    return ordered


def _feeds(speaker: str, hearer: str, wiring: Wiring) -> bool:
    said = [end.port for end in wiring.said if end.service == speaker and end.port.name != ANYTHING]
    return any(end.port.hears(port) for end in wiring.heard if end.service == hearer for port in said)


def _asked(wiring: Wiring) -> tuple[list[str], list[str]]:
    """The messages that answer a frame, and others that the application is heard saying."""
    asked = [end for end in wiring.heard if end.port.kind == "message" and _of_the_application(end, wiring)]
    declared = _names(wiring.answers)
    driving = _names(end for end in asked if end.layer == "action")
    judged = _names(end for end in asked if end.layer == "evaluation" and not end.port.optional)
    answers = declared or driving or judged
    return answers, [name for name in _names(asked) if name not in answers]


def _of_the_application(end: End, wiring: Wiring) -> bool:
    return not any(end.port.hears(o.port) for o in wiring.said if o.port.name != ANYTHING) and end.port.may_be_asked


def _names(ends: object) -> list[str]:
    return sorted({str(end.port) for end in ends})  # type: ignore[attr-defined]
