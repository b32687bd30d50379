"""A test whose drives end as their values say, without processes."""

import asyncio
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dodo_dsl.cli import search_session
from dodo_dsl.outcome import with_margin
from dodo_dsl.plan.model import Plan
from dodo_dsl.run.protocol import Exited, Ready, VerdictEvent
from tests.check import examples
from tests.run import scripted
from tests.run.scripted import Events, ScriptedBackend, ScriptedBackends

SPEC = """\
vary:
  start: {from: -8 cm, to: 8 cm, nominal: 0 cm}
  clutter: {from: 0, to: 100, nominal: 0}
environment: {camera: {uses: virtual-camera, with: {map-path: ../maps/plain, clutter: "${vary.clutter}"}}}
action: {vehicle: {uses: dynamic-model}, pose: {uses: integrator, with: {x: "${vary.start}"}}}
# docker-compose.yml
services:
  driver:
    image: driver
    command: --cid=111
    x-dodo: {in: [], out: [opendlv.proxy.GroundSteeringRequest, opendlv.proxy.PedalPositionRequest]}
    x-dodo-process: [python, driver.py]
"""
LIMIT = 0.05
"""Drives that begin further to the right fail."""
BROKEN = -0.06
"""Those that begin further to the left end in error."""


def start_of(plan: Plan) -> float:
    pose = next(service for service in plan.services if service.name == "pose")
    return float(next(flag.value for flag in pose.flags if flag.name == "x"))


def wall_of(plan: Plan) -> str:
    """The wall that a drive hits; which one says nothing of its cause."""
    camera = next(service for service in plan.services if service.name == "camera")
    return "left" if float(next(flag.value for flag in camera.flags if flag.name == "clutter")) > 0 else "right"


def stages(plan: Plan, limit: float = LIMIT) -> dict[str, Events]:
    start = start_of(plan)
    ready = {
        layer: [(0.0, Ready(service.name)) for service in plan.layer(layer)]
        for layer in ("environment", "action", "evaluation")
    }
    if start < BROKEN:
        return {**ready, "begin": [(0.0, Exited("track", 1))]}
    ok = start <= limit
    check = with_margin({"name": "start", "value": start, "limit": {"max": limit}, "unit": "m", "ok": ok})
    reason = "it drove" if ok else f"hit wall {wall_of(plan)} after {start:.3f} m"
    return {**ready, "begin": [(0.0, VerdictEvent("track", ok, reason, (check,))), (0.0, Exited("track", 0))]}


@contextmanager
def repository(folder: Path, spec: str) -> Iterator[pytest.MonkeyPatch]:
    """A folder with a test, from which commands are called."""
    examples.write(spec, folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("DODO_LEASES", str(folder / "leases"))
        yield patch


@contextmanager
def scripted_commands(folder: Path, spec: str, make: Callable[[Plan, int], ScriptedBackend]) -> Iterator[None]:
    """In a repository, ``dodo search`` and ``dodo tune`` drive by backends that ``make`` makes."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    with repository(folder, spec) as patch:
        stub(patch, make)
        yield
    for number, handler in before.items():
        signal.signal(number, handler)


def stub(patch: pytest.MonkeyPatch, make: Callable[[Plan, int], ScriptedBackend]) -> None:
    patch.setattr(asyncio, "run", scripted.run)
    patch.setattr(search_session, "CombinedBackends", lambda *_, **__: ScriptedBackends(make))
    patch.setattr(os, "fsync", lambda _: None)  # no power cut is tried
