"""What the test's time costs a program: a read of the clock beside the kernel's, and how fast its timers go.

    python benchmarks/bench_clock.py

Without the library, a read is one of the vDSO, without a system call. Processor time, of one core.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, attempt, cost_row, plan, rate_row, report
from tests.services.clock.native.application import Application, compiled, refusal

READ, TIMER = "the test's time, a read of the clock", "the test's time, a program with a timer of 100 Hz"
READ_GOAL, TIMER_GOAL = Goal(200.0, "value"), Goal(10.0, "value")
MEASURED_S = 8.0
ROUNDS = 9


def read_ns(built: Path) -> tuple[float, float]:
    """With the library, and without."""
    with Application(built, [built / "programs", "reads"]) as application:
        application.run(1)
        assert application.code() == 0
        ours = float(application.output())
    theirs = subprocess.run([built / "programs", "reads"], check=True, capture_output=True, text=True).stdout
    return ours, float(theirs)


def times_real_time(built: Path) -> float:
    with Application(built, [built / "programs", "ticks"]) as application:
        application.run(0)
        began = time.monotonic()
        application.run(MEASURED_S)
        return MEASURED_S / (time.monotonic() - began)


def main() -> int:
    budget = Budget.given()
    first = cost_row(READ, "ns", [], "vDSO", [], goal=READ_GOAL)
    second = rate_row(TIMER, "x real time", [], goal=TIMER_GOAL, note="no peer")
    why = refusal()
    if why:
        plan(first, second, note=why)
        return 0
    plan(first, second)
    with tempfile.TemporaryDirectory() as name:
        built = compiled(Path(name), "-O2")
        with attempt(first):
            ours, theirs = zip(*(read_ns(built) for _ in budget.rounds(ROUNDS, until=0.5)), strict=True)
            report(cost_row(READ, "ns", ours, "vDSO", theirs, goal=READ_GOAL))
            print(f"{READ}: {sorted(ours)[len(ours) // 2]:.1f} ns, vDSO {sorted(theirs)[len(theirs) // 2]:.1f} ns")
        with attempt(second):
            rates = [times_real_time(built) for _ in budget.rounds(ROUNDS)]
            report(rate_row(TIMER, "x real time", rates, goal=TIMER_GOAL, note="no peer"))
            print(f"{TIMER}: {sorted(rates)[len(rates) // 2]:.1f} times real time")
    return 0


if __name__ == "__main__":
    sys.exit(main())
