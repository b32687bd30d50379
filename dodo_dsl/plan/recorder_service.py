"""The recorder that every test has: all messages, and the pictures of the test's cameras."""

import re
from collections.abc import Iterable, Iterator

from dodo_dsl.check.lockstep import cameras_of, rates
from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.plan.model import Flag, PlannedService
from dodo_dsl.spec.arguments import ResolvedService
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import NEVER, ON_FAILURE

RECORDER = "dodo-recorder"
MANIFEST = "rec-recorder"
FRAMES = "opendlv.proxy.ImageReading"
RECORDING, PICTURES_FILE, SNAPSHOT = "test.rec", "frames.rec", "snapshot.png"
"""In the folder of a test's report; that of pictures stays only where the test did not pass."""

_EACH_HZ = 1000
"""More than any camera has: each picture."""
_PARAMETER = re.compile(r"\{([a-z0-9.-]+)\}")


def recorder(test: ResolvedTest, manifest: Manifest, image: str, cid: int) -> PlannedService:
    """The recorder's service, as ``record`` of the spec has it. A test on a rig has a snapshot of its first camera."""
    spec = test.spec
    flags = [Flag("rec", RECORDING, "report"), Flag("commands", "false")]  # the application could stop it
    flags += [Flag("limit", f"{spec.record_limit_mb:g}")] if spec.record_limit_mb else []
    wanted = list(_pictures(test))
    wanted += [Flag("snapshot", SNAPSHOT, "report")] if spec.level == "hil" else []
    memories = ",".join(_memories(test.services)) if wanted else ""
    if memories:
        flags += [*wanted, Flag("memories", memories, "memories")]
    return PlannedService("environment", RECORDER, MANIFEST, image, manifest.process, (*flags, Flag("cid", str(cid))))


def _pictures(test: ResolvedTest) -> Iterator[Flag]:
    spec = test.spec
    if spec.frames == NEVER:
        return
    yield Flag("frames", f"{spec.frames_hz or _own_hz(test):g}")
    if spec.frames == ON_FAILURE:
        yield Flag("pictures", PICTURES_FILE, "report")


def _own_hz(test: ResolvedTest) -> float:
    """The rate of the fastest camera."""
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
