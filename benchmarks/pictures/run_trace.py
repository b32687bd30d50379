"""Runs ``dodo run`` and shows where its time went, in a table and as a trace for a browser.

python -m benchmarks.pictures.run_trace OUT.json [WORD of dodo run ...]
"""

import contextlib
import json
import os
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

from dodo_dsl import atomic
from dodo_dsl.cli import progress
from dodo_dsl.cli import run as cli_run
from dodo_dsl.cli.main import main as dodo
from dodo_dsl.outcome import Outcome

COMMAND, OWN = "dodo run", "processor of dodo run, s"
BEGINS = {"prepare": "compile", "run": "run", "save_report": "report"}
"""Functions of the command, and the phases that begin with them."""


class Trace:
    """Phases of the command and of each test, in Chrome's trace event format, in which times are in us."""

    def __init__(self) -> None:
        self.events: list[dict[str, Any]] = []
        self._open: dict[str, dict[str, Any]] = {}
        self._lanes: dict[str, int] = {}
        ticks = int(Path("/proc/self/stat").read_text().rpartition(")")[2].split()[19])
        self._started = ticks / os.sysconf("SC_CLK_TCK")
        self.enter(COMMAND, "start and load")
        self._open[COMMAND].update({"ts": 0, "args": {OWN: 0.0}})  # since this process began

    def enter(self, lane: str, name: str = "") -> None:
        """A phase begins, which ends the one before it in the same lane; without a name, none begins."""
        now, own = time.clock_gettime(time.CLOCK_BOOTTIME) - self._started, time.process_time()
        if lane not in self._lanes:
            self._lanes[lane] = len(self._lanes)
            head = {"name": "thread_name", "ph": "M", "args": {"name": lane}}
            self.events.append({**head, "pid": 1, "tid": self._lanes[lane]})
        if last := self._open.pop(lane, None):
            last["dur"], last["args"][OWN] = round(now * 1e6) - last["ts"], own - last["args"][OWN]
            self.events.append(last)
        if name:
            place = {"pid": 1, "tid": self._lanes[lane], "ts": round(now * 1e6)}
            self._open[lane] = {"name": name, "ph": "X", **place, "args": {OWN: own}}

    def table(self) -> Iterator[str]:
        """The command's own phases, then those of the tests: the median of each."""
        groups: dict[str, list[dict[str, Any]]] = {}
        for phase in (event for event in self.events if event["ph"] == "X"):
            groups.setdefault(("  " if phase["tid"] else "") + phase["name"], []).append(phase)
        yield f"{'where the time went':32}  {'s':>7}  {OWN:>24}"
        for name in sorted(groups, key=lambda name: name.startswith(" ")):
            wall = statistics.median(phase["dur"] / 1e6 for phase in groups[name])
            own = statistics.median(phase["args"][OWN] for phase in groups[name])
            yield f"{name:32}  {wall:7.2f}  {own:24.2f}"


def run(trace: Trace, words: Sequence[str]) -> int:
    """``dodo run`` in this process; returns its exit code."""

    class Traced(progress.PlainProgress):
        def phase(self, slug: str, text: str) -> None:
            trace.enter(slug, text)
            super().phase(slug, text)

        def done(self, outcome: Outcome) -> None:
            trace.enter(outcome.slug)
            super().done(outcome)

    def entering(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def traced(*values: Any, **named: Any) -> Any:
            trace.enter(COMMAND, name)
            return function(*values, **named)

        return traced

    with contextlib.ExitStack() as stack:
        stack.enter_context(mock.patch.object(progress, "choose", lambda stream, slugs, _: Traced(stream, slugs)))
        for name, phase in BEGINS.items():
            stack.enter_context(mock.patch.object(cli_run, name, entering(phase, getattr(cli_run, name))))
        code = dodo(["run", *words], sys.stdout, sys.stderr)
        trace.enter(COMMAND)
    return code


def main(words: Sequence[str]) -> int:
    if not words or words[0].startswith("-"):
        print(__doc__, file=sys.stderr)
        return 2
    trace = Trace()
    code = run(trace, words[1:])
    print(*trace.table(), sep="\n")
    atomic.write_text(Path(words[0]), json.dumps({"traceEvents": trace.events, "displayTimeUnit": "ms"}, indent=1))
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
