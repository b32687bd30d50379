"""The clock service of a test in lockstep: the order of its services, and the messages that answer a frame."""

from collections.abc import Mapping, Sequence

from dodo_dsl.application.model import Declared
from dodo_dsl.check.lockstep import answers, cameras_of, other_inputs, rates, step_hz
from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.check.wiring import ANYTHING, Wiring
from dodo_dsl.plan.model import Flag, Lockstep, PlannedService
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import Spec

CLOCK = "dodo-clock"
MANIFEST = "clock"
RUNNER_VARIABLE = "DODO_RUNNER"
"""Empty in the clock's container where no runner announces the begin of the test, as with ``docker compose up``."""

_WALL_FACTOR, _WALL_SPARE_S = 10.0, 60.0


def lockstep(
    spec: Spec, declared: Mapping[str, Declared | None], wall_timeout_s: float | None = None
) -> Lockstep | None:
    """The lockstep of a test, None in real time; its wall time is by default limited to ten timeouts and 60 s."""
    if spec.clock != "lockstep":
        return None
    readers = sum(own.readers for own in declared.values() if own)
    wall = (spec.timeout_s or 0.0) * _WALL_FACTOR + _WALL_SPARE_S if wall_timeout_s is None else wall_timeout_s
    return Lockstep(readers or 1, wall, spec.max_response_s, spec.response_over, spec.copies_times)


def clock(test: ResolvedTest, manifest: Manifest, image: str, watch: Sequence[str], cid: int) -> PlannedService:
    """The service that steps a test; ``watch`` are services that only observe."""
    spec, wiring = test.spec, test.wiring
    layers = {layer: [u.name for u in spec.uses if u.layer == layer] for layer in ("environment", "action")}
    sense = _ordered(layers["environment"], wiring)
    cameras = cameras_of(wiring)
    sense.sort(key=lambda name: name in cameras)
    values = {
        "freq": f"{step_hz(wiring, rates(test.services)):.12g}",
        "advance": ",".join(_ordered(layers["action"], wiring)),
        "sense": ",".join(sense),
        "judge": ",".join(u.name for u in spec.uses if u.layer == "evaluation"),
        "watch": ",".join(watch),
        "answers": ",".join(answers(wiring)),
        "hears": ",".join(other_inputs(wiring)),
        "done": wiring.done,
        "timeout": f"{spec.timeout_s or 0.0:g}",
        "max-response": "" if spec.max_response_s is None else f"{spec.max_response_s:g}",
        "cid": str(cid),
    }
    flags = tuple(Flag(name, value) for name, value in values.items() if value)
    return PlannedService("environment", CLOCK, manifest.name, image, manifest.process, flags)


def _ordered(names: Sequence[str], wiring: Wiring) -> list[str]:
    """Producers before their consumers; services that consume from one another keep the order of the spec."""
    left, ordered = list(names), []
    while left:
        free = [name for name in left if not any(_feeds(other, name, wiring) for other in left if other != name)]
        chosen = (free or left)[0]
        left.remove(chosen)
        ordered.append(chosen)
    return ordered


def _feeds(producer: str, consumer: str, wiring: Wiring) -> bool:
    produced = [end.port for end in wiring.produced if end.service == producer and end.port.name != ANYTHING]
    return any(end.port.consumes(port) for end in wiring.consumed if end.service == consumer for port in produced)
