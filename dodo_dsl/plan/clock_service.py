"""What the clock of a test in lockstep is told: who goes on when, and what answers a frame."""

from collections.abc import Mapping, Sequence

from dodo_dsl.check.context import Context, Declared
from dodo_dsl.check.lockstep import answers, cameras_of, heard, rates, step_hz
from dodo_dsl.check.wiring import ANYTHING, Wiring, wire
from dodo_dsl.plan.model import Flag, Lockstep, Service
from dodo_dsl.spec.model import Spec

CLOCK = "dodo-clock"
MANIFEST = "clock"

_WALL_FACTOR, _WALL_SPARE_S = 10.0, 60.0


def lockstep(spec: Spec, declared: Mapping[str, Declared | None]) -> Lockstep | None:
    """How a test steps, None in real time; it may take much longer than its own time before it is given up."""
    if spec.clock != "lockstep":
        return None
    readers = sum(own.readers for own in declared.values() if own)
    return Lockstep(readers or 1, (spec.timeout_s or 0.0) * _WALL_FACTOR + _WALL_SPARE_S)


def clock(context: Context, image: str, watch: Sequence[str], cid: int) -> Service:
    """The service that steps a test; ``watch`` are services that only look on."""
    manifest, spec, wiring = context.manifests[MANIFEST], context.spec, wire(context)
    layers = {layer: [u.name for u in spec.uses if u.layer == layer] for layer in ("environment", "action")}
    sense = _ordered(layers["environment"], wiring)
    cameras = cameras_of(wiring)
    sense.sort(key=lambda name: name in cameras)
    values = {
        "freq": f"{step_hz(wiring, rates(context)):.12g}",
        "advance": ",".join(_ordered(layers["action"], wiring)),
        "sense": ",".join(sense),
        "judge": ",".join(u.name for u in spec.uses if u.layer == "evaluation"),
        "watch": ",".join(watch),
        "answers": ",".join(answers(wiring)),
        "hears": ",".join(heard(wiring)),
        "done": wiring.done,
        "timeout": f"{spec.timeout_s or 0.0:g}",
        "cid": str(cid),
    }
    flags = tuple(Flag(name, value) for name, value in values.items() if value)
    return Service("environment", CLOCK, manifest.name, image, manifest.process, flags)


def _ordered(names: Sequence[str], wiring: Wiring) -> list[str]:
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
