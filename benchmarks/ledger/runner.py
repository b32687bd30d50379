"""Starts benchmarks as processes, each with its budget of seconds, and reads their rows."""

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from benchmarks.ledger import budget, row
from benchmarks.ledger.ledger import Bench

SECONDS = {
    "bench_bus": 33,
    "bench_camera": 33,
    "bench_clock": 15,
    "bench_compile": 44,
    "bench_docker": 43,
    "bench_editor": 26,
    "bench_lockstep": 44,
    "bench_parallel": 46,
    "bench_pull": 25,
    "bench_ranges": 14,
    "bench_rec": 34,
    "bench_recorder": 33,
    "bench_replay": 33,
    "bench_report": 20,
    "bench_ros": 14,
    "bench_services": 33,
    "bench_setup": 43,
    "bench_startup": 16,
}
"""Budgets of the benchmarks; of ten minutes they leave some for those that have to be ended."""
OTHERS = 40
RESERVE = 0.85
"""Of its budget a benchmark plans with this part, so that it ends by itself."""
INTERRUPTED = "interrupted"
GRACE = 10.0
"""Seconds to clean up for one that did not end."""


class Interrupted(Exception):
    """Somebody ended the benchmark, and all that were to follow; what it had measured is kept."""

    def __init__(self, bench: Bench) -> None:
        super().__init__(bench.trouble)
        self.bench = bench


def scripts(checkout: Path) -> list[Path]:
    return sorted((checkout / "benchmarks").glob("bench_*.py"))


def run(script: Path, seconds: float) -> Bench:
    """One benchmark of the checkout that the script is in; one that does not end in time is ended.

    The rows that it did not come to say why, if it failed or was ended. Raises Interrupted.
    """
    checkout = script.parents[1]
    with tempfile.TemporaryDirectory() as folder:
        rows, errors = Path(folder) / "rows.jsonl", Path(folder) / "stderr"
        environment = {
            **os.environ,
            "PYTHONPATH": str(checkout),
            row.FILE_VARIABLE: str(rows),
            budget.VARIABLE: str(seconds * RESERVE),
        }
        begin, load = time.monotonic(), os.getloadavg()[0]
        code, is_interrupted = None, False
        try:
            with _started([sys.executable, str(script)], checkout, environment, errors) as process:
                code = _wait(process, seconds)
        except KeyboardInterrupt:
            is_interrupted = True
        took = time.monotonic() - begin
        said = errors.read_text(errors="replace")
        if code is not None:  # one that was ended says only where it stood
            sys.stderr.write(said)
        trouble = INTERRUPTED if is_interrupted else _trouble(code, seconds, said)
        found = tuple(
            replace(one, note=trouble) if trouble and one.note == row.NOT_REACHED else one
            for one in row.read_rows(rows)
        )
    if not found:
        trouble = trouble or "reported no row"
        found = (row.Row(script.stem, "", note=trouble),)
    bench = Bench(script.stem, found, round(took, 1), seconds, (load, os.getloadavg()[0]), trouble, bool(code))
    if is_interrupted:
        raise Interrupted(bench)
    return bench


def not_run(script: Path) -> Bench:
    """One that an interrupt left no time for."""
    load = os.getloadavg()[0]
    return Bench(script.stem, (row.Row(script.stem, "", note="interrupted before it"),), 0.0, 0.0, (load, load))


def _trouble(code: int | None, seconds: float, said: str) -> str:
    """Why a benchmark ended badly, with the first line of the exception that ended it; empty for one that did not."""
    if code is None:
        return f"did not end in {seconds:.3g} s, and was ended"
    if not code:
        return ""
    reasons = [line for line in said.splitlines() if line[:1].strip() and not line.startswith("Traceback")]
    return f"ended with {code}" + (f": {reasons[0][: row.MOST_LETTERS]}" if reasons else "")


def _wait(process: "subprocess.Popen[bytes]", seconds: float) -> int | None:
    """The exit code, None for one that does not end in time."""
    try:
        return process.wait(seconds)
    except subprocess.TimeoutExpired:
        return None


def _interruptible() -> None:
    """Undoes what shells do to programs in the background: they ignore SIGINT, and so would the benchmark."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextmanager
def _started(
    command: list[str], folder: Path, environment: dict[str, str], errors: Path
) -> Iterator["subprocess.Popen[bytes]"]:
    """A process with its own group, all of which is gone after the block; first they may clean up."""
    with errors.open("wb") as stream:
        process = subprocess.Popen(
            command, cwd=folder, env=environment, start_new_session=True, stderr=stream,
            preexec_fn=_interruptible,  # noqa: PLW1509 - the ledger has one thread
        )  # fmt: skip
    try:
        yield process
    finally:
        try:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGINT)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(GRACE)
        finally:  # also if somebody does not wait for that
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
