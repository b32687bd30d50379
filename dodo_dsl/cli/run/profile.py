"""``dodo run --profile``: where the time of a run goes, as a table and as a trace for a browser."""

import contextlib
import json
import math
import os
import statistics
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from dodo_dsl import atomic
from dodo_dsl.outcome import Outcome
from dodo_dsl.run.runner import Progress
from dodo_dsl.run.standing import Standing

FILE_NAME = "profile.json"
COMMAND = "dodo run"
_TICKS = os.sysconf("SC_CLK_TCK")
_STAT = Path("/proc/stat")


@dataclass(frozen=True)
class Moment:
    """The time at an instant, in s: since the command's start, on its processor, on all processors of the machine."""

    wall: float
    own: float
    machine: float


@dataclass(frozen=True)
class Phase:
    """What was done by the command itself or in a test (``lane``), from one instant to another."""

    lane: str
    name: str
    begin: Moment
    end: Moment


class Profile:
    """Phases of a run, from the start of this process on."""

    def __init__(self) -> None:
        self._started = _process_started()
        self.phases: list[Phase] = []
        self._open = {COMMAND: ("start and load", Moment(0.0, 0.0, math.nan))}

    def enter(self, lane: str, name: str) -> None:
        """A phase begins, which ends the one before it in the same lane."""
        self.leave(lane)
        self._open[lane] = (name, self._now())

    def leave(self, lane: str) -> None:
        """The phase of a lane ends, if there is one."""
        if lane in self._open:
            name, begin = self._open.pop(lane)
            self.phases.append(Phase(lane, name, begin, self._now()))

    def _now(self) -> Moment:
        return Moment(time.clock_gettime(time.CLOCK_BOOTTIME) - self._started, time.process_time(), _machine_s())

    def table(self) -> Iterator[str]:
        """Lines: the command's own phases, then those of the tests, the median where there are several."""
        yield f"{'where the time went':32}  {'s':>7}  {'processor of dodo run':>21}  {'of the machine':>14}"
        for phase in (phase for phase in self.phases if phase.lane == COMMAND):
            yield _row(phase.name, [phase])
        tests = [phase for phase in self.phases if phase.lane != COMMAND]
        count = len({phase.lane for phase in tests})
        if count:
            yield "of the test" if count == 1 else f"of {count} tests, the median"
        for name in dict.fromkeys(phase.name for phase in tests):
            yield _row(f"  {name}", [phase for phase in tests if phase.name == name])

    def write(self, target: Path) -> None:
        """The phases in Chrome's trace event format, which Perfetto and chrome://tracing show."""
        lanes = list(dict.fromkeys(phase.lane for phase in self.phases))
        names = [
            {"name": "thread_name", "ph": "M", "pid": 1, "tid": number, "args": {"name": lane}}
            for number, lane in enumerate(lanes)
        ]
        spans = [
            {
                "name": phase.name,
                "ph": "X",
                "pid": 1,
                "tid": lanes.index(phase.lane),
                "ts": round(phase.begin.wall * 1e6),
                "dur": round((phase.end.wall - phase.begin.wall) * 1e6),
                "args": {"processor of dodo run, s": round(phase.end.own - phase.begin.own, 3)},
            }
            for phase in self.phases
        ]
        atomic.write_text(
            target, json.dumps({"traceEvents": [*names, *spans], "displayTimeUnit": "ms"}, indent=1) + "\n"
        )


class ProfiledProgress:
    """Shows how the run goes as ``shown`` does, and keeps its phases in a profile."""

    def __init__(self, shown: Progress, profile: Profile) -> None:
        self._shown, self._profile = shown, profile

    def __enter__(self) -> Self:
        self._shown.__enter__()
        return self

    def __exit__(self, *reason: object) -> None:
        self._shown.__exit__(*reason)

    def note(self, text: str) -> None:
        self._shown.note(text)

    def phase(self, slug: str, text: str) -> None:
        self._profile.enter(slug, text)
        self._shown.phase(slug, text)

    def standing(self, slug: str, standing: Standing) -> None:
        self._shown.standing(slug, standing)

    def done(self, outcome: Outcome) -> None:
        self._profile.leave(outcome.slug)
        self._shown.done(outcome)

    def rest(self, seconds: float, tests: int) -> None:
        self._shown.rest(seconds, tests)


def _row(name: str, phases: list[Phase]) -> str:
    wall, own, machine = (
        statistics.median(getattr(phase.end, kind) - getattr(phase.begin, kind) for phase in phases)
        for kind in ("wall", "own", "machine")
    )
    known = "unknown" if math.isnan(machine) else f"{machine:.2f}"
    return f"{name:32}  {wall:7.2f}  {own:21.2f}  {known:>14}"


def _machine_s() -> float:
    """Processor time used on the whole machine so far, in s; NaN where the kernel does not say."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        user, nice, system, _idle, _wait, *interrupts = map(int, _STAT.read_text().split("\n", 1)[0].split()[1:8])
        return (user + nice + system + sum(interrupts)) / _TICKS
    return math.nan


def _process_started() -> float:
    """When this process started, in s of the kernel's time since boot; precise to its ticks of 10 ms."""
    return int(Path("/proc/self/stat").read_text().rpartition(")")[2].split()[19]) / _TICKS
