"""The registry's tests in lockstep beside real time, with the example application.

Prints test time over wall time of each (sim_s / execution_s, in real time about 1), and the whole suite's time; then
how long one short test takes from command to end, and how many more of it a minute brings with two at once. In the
ledger the test's own time stands for real time, and the tests are those with a goal.
"""

import json
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from players import ROOT, finished

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, attempt, cost_row, plan, rate_row, report

ROUNDS, REPEATS = 3, 10
SHORT = "sil-closed-straight"
GOALS = {SHORT: None, "sil-closed-kiwi-track": Goal(20), "sil-perception": Goal(8)}
LEVELS = ("--level", "sil", "--level", "dil")
Tests = dict[str, dict[str, Any]]


def run(report: Path, *words: str) -> tuple[Tests, float]:
    """The tests' results by slug, and the command's seconds."""
    command = [sys.executable, "-m", "dodo_dsl", "run", *words, "--report", str(report)]
    start = time.perf_counter()
    if code := finished(command, ROOT):
        raise RuntimeError(f"dodo run {' '.join(words)} ended with {code}")
    seconds = time.perf_counter() - start
    return {t["slug"]: t for t in json.loads((report / "results.json").read_text())["tests"]}, seconds


def speed_row(slug: str, ours: list[float], peer: str = "real time", theirs: Sequence[float] = ()) -> Row:
    return cost_row(f"{slug} in lockstep", "s", ours, peer, theirs, goal=GOALS.get(slug))


def rows_of(alone: list[float], minutes: list[float]) -> list[Row]:
    return [
        cost_row(f"{SHORT}, command to end", "s", alone, goal=Goal(1.2, of="value")),
        rate_row(f"{SHORT}, further runs, two at once", "a minute", minutes, goal=Goal(60, of="value")),
    ]


def speeds(folder: Path, budget: Budget) -> None:
    """The tests one after the other in lockstep."""
    rounds = []
    for number in budget.rounds(ROUNDS):
        rounds.append(run(folder / str(number), *LEVELS, "--clock", "lockstep", "-j", "1"))
        for slug in rounds[0][0]:
            ours = [tests[slug] for tests, _ in rounds]
            both = [t["execution_s"] for t in ours], "real time", [t["sim_s"] for t in ours]
            report(speed_row(slug, *both))
    print(f"{'test':24s} lockstep    test time   times real time (median of {len(rounds)}, best)")
    for slug in rounds[0][0]:
        ours = [tests[slug] for tests, _ in rounds]
        times = [t["sim_s"] / t["execution_s"] for t in ours]
        execution = statistics.median(t["execution_s"] for t in ours)
        ratio = f"{statistics.median(times):6.1f} {max(times):6.1f}"
        print(f"{slug:24s} {execution:7.2f} s {ours[0]['sim_s']:9.1f} s   {ratio}")
    print(f"all of them, one after the other: {statistics.median(seconds for _, seconds in rounds):.1f} s in lockstep")


def speeds_in_turn(folder: Path, budget: Budget) -> None:
    """The tests with a goal in lockstep, each by itself, so that those that came to an end have rows."""
    found: dict[str, list[tuple[float, float]]] = {slug: [] for slug in GOALS}
    for _ in budget.rounds(ROUNDS):
        for slug, times in list(found.items()):
            with attempt(speed_row(slug, [])):
                one_speed(folder, slug, times)
            if not times:
                del found[slug]


def one_speed(folder: Path, slug: str, times: list[tuple[float, float]]) -> None:
    """One more round of a test."""
    test = next(iter(run(folder / "speeds", slug, "--clock", "lockstep")[0].values()))  # the first of a matrix
    times.append((test["execution_s"], test["sim_s"]))
    ours, theirs = (list(column) for column in zip(*times, strict=True))
    report(speed_row(slug, ours, "real time", theirs))
    print(f"{slug:24s} {ours[-1]:7.2f} s, {theirs[-1] / ours[-1]:5.1f} times real time", flush=True)


def one_and_more(folder: Path, budget: Budget) -> None:
    """A short test alone, and again and again in one command; fewer rounds and repetitions within a budget."""
    alone: list[float] = []
    minutes: list[float] = []
    rounds, repeats = (1, 4) if budget.limited else (ROUNDS, REPEATS)
    for _ in range(rounds):
        alone.append(run(folder / "one", SHORT)[1])
        report(rows_of(alone, minutes)[0])
        more = run(folder / "more", SHORT, "--repeat", str(repeats), "-j", "2")[1]
        minutes.append(60 * (repeats - 1) / (more - alone[-1]))
        report(*rows_of(alone, minutes))
    print(f"{SHORT}: {statistics.median(alone):.2f} s, {statistics.median(minutes):.0f} further ones a minute")


def main() -> int:
    budget = Budget.given()
    plan(*(speed_row(slug, []) for slug in GOALS), *rows_of([], []))
    with tempfile.TemporaryDirectory() as name:
        with attempt(*rows_of([], [])):
            one_and_more(Path(name), budget)
        if budget.limited:
            speeds_in_turn(Path(name), budget)
        else:
            speeds(Path(name), budget)
            tests, seconds = run(Path(name) / "realtime", *LEVELS, "--clock", "realtime", "-j", "1")
            for slug, test in tests.items():
                print(f"{slug:24s} {test['execution_s']:7.1f} s in real time")
            print(f"all of them, one after the other: {seconds:.1f} s in real time")
    return 0


if __name__ == "__main__":
    sys.exit(main())
