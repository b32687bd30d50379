"""Drives of tests that failed, made without running them: a recording, logs, an outcome, and the test's real Plan."""

import base64
import functools
import importlib
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dodo_dsl import compiler
from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.log_times import JUDGED_SUFFIX
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording_writer import RecordingWriter
from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.model import Plan
from services.base import Context, Service
from services.base.flags import load_manifest, parse
from services.base.service import Build
from tests.report.joined.reports import draw

ROOT = Path(__file__).parents[3]
EPOCH = 1_700_000_000_000_000
WALL = 1_795_000_000_000_000
"""us since the epoch: of a test in lockstep, and of the machine that it ran on."""
SPEED = 20.0
"""Seconds of test time in one of wall time."""
MESSAGES = MessageSet.standard()

Sample = tuple[float, str, int, dict[str, Any]]
"""Time in s, message, sender stamp and fields."""
Pose = tuple[float, float, float]
"""x and y in m, heading in rad."""


@dataclass(frozen=True)
class MadeDrive:
    """A test of the registry by its slug, what was on its bus for ``duration`` s, and what became of it."""

    slug: str
    duration: float
    samples: Sequence[Sample]
    outcome: dict[str, Any]
    logs: dict[str, Sequence[tuple[float, str]]] = field(default_factory=dict)
    """Lines by the log's name, each with its time in s of the test."""


@functools.cache
def shipped(slug: str) -> Plan:
    """The Plan of a test of the registry."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        made = compiler.plan(compiler.load([ROOT / "tests_registry" / slug.partition("--")[0]]), Path("generated"))
    return next(plan for plan in made.compiled.suite.plans if plan.slug == slug)


def unpacked(text: str) -> NDArray[np.float32]:
    return np.frombuffer(base64.b64decode(text, validate=True), "<f4")


def write(report: Path, drives: Iterable[MadeDrive]) -> list[Outcome]:
    """A report of these drives, as ``dodo run`` writes one."""
    compiled = report.parent / "compiled"
    compiled.mkdir()
    (compiled / "files").symlink_to(ROOT / "tests_registry")
    outcomes, tests = [], {}
    for number, drive in enumerate(drives):
        plan = shipped(drive.slug)
        slug = f"test-{number}"
        outcomes.append(outcome_of(drive, slug))
        tests[slug] = (replace(plan, slug=slug), compiled)
        record(report / slug / "test.rec", drive)
        log(report / slug / "logs", drive)
        judge(report / slug / "logs", plan, compiled, drive)
    assert draw(report, outcomes, tests) == []
    return outcomes


def outcome_of(drive: MadeDrive, slug: str) -> Outcome:
    plain = Outcome(drive.slug, slug, "t.dodo.yml", "sil", "closed-loop", "failed", "", 130, 0, "lockstep", "process")
    decided = [verdict["evaluator"] for verdict in drive.outcome.get("verdicts", ())]
    return replace(plain, **{"decided_by": "".join(decided[:1]), **drive.outcome})


def record(path: Path, drive: MadeDrive, epoch: int = EPOCH, speed: float = SPEED) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with RecordingWriter(path) as writer:
        begin = [(0.0, "dodo.TestBegin", 0, {})]
        end = [(drive.duration, "dodo.RecordingEnd", 0, {})]
        for time, name, sender, fields in (*begin, *sorted(drive.samples, key=lambda s: s[0]), *end):
            sampled, wall = epoch + round(time * 1e6), WALL + round(time * 1e6 / speed)
            payload = MESSAGES.encode(MESSAGES.type(name)(**fields))
            writer.write(Envelope(MESSAGES.id(name), payload, wall, wall, sampled, sender))


def log(folder: Path, drive: MadeDrive) -> None:
    folder.mkdir()
    for name, lines in drive.logs.items():
        offset, times = 0, []
        for time, line in lines:
            times.append(f"{offset} {WALL + round(time * 1e6 / SPEED)}\n")
            offset += len(line.encode()) + 1
        (folder / f"{name}.log").write_text("".join(f"{line}\n" for _, line in lines))
        (folder / f"{name}.times").write_text("".join(times))


def judge(folder: Path, plan: Plan, compiled: Path, drive: MadeDrive) -> None:
    """What the test's evaluators record of the samples, beside the logs."""
    for service in plan.services if drive.samples else ():
        if service.judge:
            package = f"services.{service.uses.replace('-', '_')}"
            manifest = load_manifest(ROOT / package.replace(".", "/"))
            words = [f"--{f.name}={compiled / FILES / f.value if f.kind == 'path' else f.value}" for f in service.flags]
            build: Build = importlib.import_module(f"{package}.service").build
            evaluator = build(Context(service.name, parse(manifest, words), MESSAGES))
            feed(evaluator, drive)
            record = folder / f"{service.layer}.{service.name}{JUDGED_SUFFIX}"
            record.write_text("".join(f"{line}\n" for line in lines_of(evaluator)))


def feed(evaluator: Service, drive: MadeDrive) -> None:
    """A drive as an evaluator in lockstep sees it, until it has its verdict."""
    evaluator.begin(EPOCH)
    step = 0
    for time, name, sender, fields in sorted(drive.samples, key=lambda sample: sample[0]):
        while step <= round(time * 100) and evaluator.verdict is None:
            evaluator.update(EPOCH + step * 10_000)
            step += 1
        now = evaluator.arrived = EPOCH + round(time * 1e6)
        for (message, stamp), handler in evaluator.inputs.items():
            if message == name and stamp in (None, sender) and evaluator.verdict is None:
                handler(MESSAGES.type(name)(**fields), now)


def lines_of(evaluator: Service) -> Iterator[str]:
    """What it prints at its end."""
    evaluator.record()
    checks = evaluator.verdict.checks if evaluator.verdict else ()
    assert evaluator.judged is not None
    return evaluator.judged.lines({check.name: check.parameters for check in checks if check.parameters})


def poses(way: Callable[[float], Pose], duration: float) -> Iterator[Sample]:
    """A Frame each 10 ms."""
    for number in range(round(duration * 100) + 1):
        time = number / 100
        x, y, heading = way(time)
        fields = {"x": x, "y": y, "qz": math.sin(heading / 2), "qw": math.cos(heading / 2)}
        yield time, "opendlv.sim.Frame", 0, fields


def requests(steering: Callable[[float], float], duration: float) -> Iterator[Sample]:
    """The application's requests each 100 ms."""
    for number in range(round(duration * 10) + 1):
        time = number / 10
        yield time, "opendlv.proxy.GroundSteeringRequest", 0, {"groundSteering": steering(time)}
        yield time, "opendlv.proxy.PedalPositionRequest", 0, {"position": 0.1}


def check(name: str, value: float | None, ok: bool, unit: str = "", **limit: float) -> dict[str, Any]:
    return {"name": name, "value": value, "limit": limit, "unit": unit, "ok": ok}


def verdict(evaluator: str, reason: str, **evidence: Any) -> dict[str, Any]:
    named = {key.replace("_", "-"): value for key, value in evidence.items()}
    return {"evaluator": evaluator, "outcome": "failed", "reason": reason, "evidence": named}
