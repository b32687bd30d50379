"""Services that the compiler adds to a test or changes: the clock, the recorder, and cameras of an emulated rig.

The clock of a test in lockstep knows the order of its services, and the messages that answer a frame. The recorder,
which every test has, takes all messages, and the pictures of the test's cameras.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from dodo_dsl.application.model import Declared
from dodo_dsl.application.ros_topics import BRIDGE
from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.check.wiring import ANYTHING, Wiring, answers, cameras_of, other_inputs, rates, step_hz
from dodo_dsl.plan.model import STARTED, ApplicationService, Flag, Lockstep, PlannedService
from dodo_dsl.spec.arguments import ResolvedService
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import NEVER, ON_FAILURE, Spec

CLOCK = "dodo-clock"
CLOCK_MANIFEST = "clock"
TIME = "dodo-time"
"""What gives the application the test's time in lockstep; its folder has that name, too."""
RUNNER_VARIABLE = "DODO_RUNNER"
"""Empty in the clock's container if no runner announces the start of the test, as with ``docker compose up``."""

_WALL_FACTOR, _WALL_SPARE_S = 10.0, 60.0


def lockstep(
    spec: Spec, declared: Mapping[str, Declared | None], wall_timeout_s: float | None = None
) -> Lockstep | None:
    """The lockstep of a test, None in real time; its wall time is by default limited to ten timeouts and 60 s."""
    if not spec.is_stepped:
        return None
    readers = sum(own.readers for own in declared.values() if own)
    wall = (spec.timeout_s or 0.0) * _WALL_FACTOR + _WALL_SPARE_S if wall_timeout_s is None else wall_timeout_s
    return Lockstep(readers or 1, wall, spec.max_response_s, spec.response_over, spec.copies_times)


TIME_FOLDER = "time-folder"
"""The clock's flag for where library and agent meet; on the host its value is another."""
ANSWERS_VARIABLE = "DODO_ANSWERS"
"""Says to the clock that the application keeps the machine's time, so that it is awaited by its answers."""
OWN_TIME = f"/dev/shm/{TIME}"
"""Where library and agent meet in a test's own memory."""
TIME_MOUNT = "/opt/dodo/time"
"""Where containers have the library and the agent."""
_EPOCH_S, _SECOND = 1_700_000_000, 1_000_000_000
_POOLS = ("OPENCV_FOR_THREADS_NUM", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Threads of the application run one at a time, so that pools of them only cost time."""


_PATIENCE_S, _MOST_PATIENCE_S = 3, 40
"""How long time waits for services that have not begun: shortly where one waits for what another has to do before."""


_MEETING_S = 3
"""How long nodes of ROS have before the test to find each other: their discovery goes by timers."""


def agent_flags(services: Sequence[ApplicationService], seed: int, folder: str = OWN_TIME) -> tuple[str, ...]:
    """The flags of what gives the ``services`` of an application the test's time."""
    begin = _EPOCH_S * _SECOND
    start = begin - _MEETING_S * _SECOND * any(service.name == BRIDGE for service in services)
    waits = any(how != STARTED for service in services for how in service.after.values())
    own = {"folder": folder, "services": len(services), "start": start, "begin": begin, "seed": seed}
    own["patience"] = _PATIENCE_S if waits else _MOST_PATIENCE_S
    return tuple(f"--{name}={value}" for name, value in own.items())


def time_variables(
    given: Mapping[str, str], number: int, seed: int, library: str, folder: str = OWN_TIME
) -> dict[str, str]:
    """The ``given`` variables of the application's service ``number``, with those that give it the test's time."""
    preloaded = ":".join(filter(None, (library, given.get("LD_PRELOAD", ""))))
    own = {"LD_PRELOAD": preloaded, "DODO_TIME": folder, "DODO_TIME_SERVICE": str(number)}
    return {**dict.fromkeys(_POOLS, "1"), "PYTHONHASHSEED": str(seed), **given, **own}


def without_time(variables: Mapping[str, str]) -> dict[str, str]:
    """Variables of a container without those by which it would load the library."""
    own = variables.get("LD_PRELOAD", "").partition(":")[2]
    kept = {name: value for name, value in variables.items() if name not in ("LD_PRELOAD", "DODO_TIME")}
    return {**kept, "LD_PRELOAD": own} if own else kept


def clock(
    test: ResolvedTest, manifest: Manifest, image: str, watch: Sequence[str], cid: int, application: Sequence[str] = ()
) -> PlannedService:
    """The service that steps a test; ``watch`` are services that only observe, ``application`` those under test."""
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
        TIME_FOLDER: OWN_TIME,
        "application": ",".join(application),
        "prints": "true" if wiring.printed else "",
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


RECORDER = "dodo-recorder"
RECORDER_MANIFEST = "rec-recorder"
FRAMES = "opendlv.proxy.ImageReading"
RECORDING, PICTURES_FILE, SNAPSHOT = "test.rec", "frames.rec", "snapshot.png"
"""In the folder of a test's report; that of pictures stays only where the test did not pass."""

_EACH_HZ = 1000
"""More than any camera has: each picture."""
_PARAMETER = re.compile(r"\{([a-z0-9.-]+)\}")


def recorder(test: ResolvedTest, manifest: Manifest, image: str, cid: int) -> PlannedService:
    """The recorder's service, as ``record`` of the spec has it. A test on a rig has a snapshot of its first camera."""
    spec = test.spec
    flags = [Flag("rec", RECORDING, "report")]
    flags += [Flag("limit", f"{spec.record_limit_mb:g}")] if spec.record_limit_mb else []
    wanted = list(_pictures(test))
    wanted += [Flag("snapshot", SNAPSHOT, "report")] if spec.level == "hil" or spec.kind == "perception" else []
    memories = ",".join(_memories(test.services)) if wanted else ""
    if memories:
        flags += [*wanted, Flag("memories", memories, "memories")]
    return PlannedService(
        "environment", RECORDER, RECORDER_MANIFEST, image, manifest.process, (*flags, Flag("cid", str(cid)))
    )


def _pictures(test: ResolvedTest) -> Iterator[Flag]:
    spec = test.spec
    if spec.frames == NEVER:
        return
    yield Flag("frames", f"{spec.frames_hz or _own_hz(test):g}")
    if spec.frames == ON_FAILURE:
        yield Flag("pictures", PICTURES_FILE, "report")


def _own_hz(test: ResolvedTest) -> float:
    known = rates(test.services)
    return max((known.get(name, _EACH_HZ) for name in cameras_of(test.wiring)), default=_EACH_HZ)


def _memories(services: Iterable[ResolvedService]) -> Iterator[str]:
    """One memory of each camera, with its size if known: I420 if there is one, which needs no conversion of colours."""
    for service in services:
        values = service.texts
        names = [_PARAMETER.sub(lambda m: values.get(m[1], ""), port) for port in _formats(service.manifest)]  # noqa: B023
        size = f":{values['width']}x{values['height']}" if {"width", "height"} <= values.keys() else ""
        yield from (f"{name.lstrip('/')}{size}" for name in filter(None, names[:1]))


def _formats(manifest: Manifest) -> list[str]:
    return sorted(manifest.memory.outputs, key=lambda port: "i420" not in port)


CAMERA, DRAWN = "camera", "virtual-camera"
SOURCE = "emulated"

_SAME = (
    "map-path", "width", "height", "freq", "fovy", "x", "y", "z", "yaw", "pitch", "frame-id", "name.argb", "name.i420",
    "name.bgr", "name.rgb", "cid",
)  # fmt: skip
_TRUTH = ("truth-sender", "truth-classes", "truth-min-visible", "truth-min-height")
_OTHER = {
    "exposure": "shutter",
    "scene.light": "exposure",
    "scene.clutter": "clutter",
    "scene.noise": "noise",
    **{f"scene.{name}": name for name in _TRUTH},
}
"""Parameters that have another name in the virtual camera."""
_STILL = (Flag("start-x", "0"), Flag("start-y", "0"), Flag("start-yaw", "0"))


def hardware(service: PlannedService, manifests: Mapping[str, Manifest], image: str) -> PlannedService:
    """The virtual camera for an emulated rig's camera; any other service unchanged.

    For the application it is the same camera, with the same memories, size, rate and pose. The exposure time becomes
    the shutter's, and the camera is at the map's origin until something moves it.
    """
    given = {flag.name: flag for flag in service.flags}
    if service.uses != CAMERA or given.get("source") != Flag("source", SOURCE):
        return service
    flags = [given[name] for name in _SAME if name in given]
    renamed = [Flag(new, given[old].value) for old, new in _OTHER.items() if old in given]
    drawn = manifests[DRAWN]
    return replace(service, uses=DRAWN, image=image, process=drawn.process, flags=(*flags, *renamed, *_STILL))
