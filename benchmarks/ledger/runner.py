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
from pathlib import Path

from benchmarks.ledger import budget, row
from benchmarks.ledger.ledger import Bench

SECONDS = {
    "bench_bus": 36,
    "bench_camera": 37,
    "bench_compile": 85,
    "bench_docker": 70,
    "bench_lockstep": 60,
    "bench_parallel": 75,
    "bench_pull": 25,
    "bench_rec": 38,
    "bench_recorder": 40,
    "bench_replay": 45,
    "bench_services": 37,
}
"""Budgets of the benchmarks; of ten minutes they leave some for those that have to be ended."""
OTHERS = 40
RESERVE = 0.85
"""Of its budget a benchmark plans with this part, so that it ends by itself."""
GRACE = 10.0
"""Seconds to clean up for one that did not end."""


def scripts(checkout: Path) -> list[Path]:
    return sorted((checkout / "benchmarks").glob("bench_*.py"))


def run(script: Path, seconds: float) -> Bench:
    """One benchmark of the checkout that the script is in; one that does not end in time is ended."""
    checkout = script.parents[1]
    with tempfile.TemporaryDirectory() as folder:
        rows = Path(folder) / "rows.jsonl"
        environment = {
            **os.environ,
            "PYTHONPATH": str(checkout),
            row.FILE_VARIABLE: str(rows),
            budget.VARIABLE: str(seconds * RESERVE),
        }
        begin, load = time.monotonic(), os.getloadavg()[0]
        with _started([sys.executable, str(script)], checkout, environment) as process:
            code = _wait(process, seconds)
        took = time.monotonic() - begin
        found = tuple(row.read_rows(rows))
    trouble = f"did not end in {seconds:.3g} s, and was ended" if code is None else f"ended with {code}" if code else ""
    if not found:
        trouble = trouble or "reported no row"
        found = (row.Row(script.stem, "", note=trouble),)
    return Bench(script.stem, found, round(took, 1), seconds, (load, os.getloadavg()[0]), trouble, bool(code))


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
def _started(command: list[str], folder: Path, environment: dict[str, str]) -> Iterator["subprocess.Popen[bytes]"]:
    """A process with a group of its own, all of which is gone after the block; first they may clean up."""
    process = subprocess.Popen(
        command, cwd=folder, env=environment, start_new_session=True,
        preexec_fn=_interruptible,  # noqa: PLW1509 - the ledger has one thread
    )  # fmt: skip
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(GRACE)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
