"""The recorder that every test has: all messages, and camera frames where the test asks for them."""

import re
from collections.abc import Iterable, Iterator

from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.plan.model import Flag, PlannedService
from dodo_dsl.spec.arguments import ResolvedService
from dodo_dsl.spec.manifest import Manifest

RECORDER = "dodo-recorder"
MANIFEST = "rec-recorder"
FRAMES = "opendlv.proxy.ImageReading"
RECORDING, SNAPSHOT = "test.rec", "snapshot.png"

_PARAMETER = re.compile(r"\{([a-z0-9.-]+)\}")


def recorder(test: ResolvedTest, manifest: Manifest, image: str, cid: int) -> PlannedService:
    """The recorder's service; ``record: {frames: ..., limit: ...}`` adds each camera's frames and limits its size.

    A test on a rig always has a snapshot of its first camera.
    """
    spec = test.spec
    flags = [Flag("rec", RECORDING, "report"), Flag("commands", "false")]  # the application could stop it
    flags += [Flag("limit", f"{spec.record_limit_mb:g}")] if spec.record_limit_mb else []
    wanted = [Flag("frames", f"{spec.frames_hz:g}")] if spec.frames_hz else []
    wanted += [Flag("snapshot", SNAPSHOT, "report")] if spec.level == "hil" else []
    memories = ",".join(_memories(test.services)) if wanted else ""
    if memories:
        flags += [*wanted, Flag("memories", memories, "memories")]
    return PlannedService("environment", RECORDER, MANIFEST, image, manifest.process, (*flags, Flag("cid", str(cid))))


def _memories(services: Iterable[ResolvedService]) -> Iterator[str]:
    """One memory of each camera, with its size if known: I420 if there is one, which needs no conversion of colours."""
    for service in services:
        values = service.texts
        names = [_PARAMETER.sub(lambda m: values.get(m[1], ""), port) for port in _formats(service.manifest)]  # noqa: B023
        size = f":{values['width']}x{values['height']}" if {"width", "height"} <= values.keys() else ""
        yield from (f"{name.lstrip('/')}{size}" for name in filter(None, names[:1]))


def _formats(manifest: Manifest) -> list[str]:
    return sorted(manifest.memory.outputs, key=lambda port: "i420" not in port)
