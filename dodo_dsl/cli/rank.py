"""dodo rank: rank applications by the goals of their tests.

Scores of teams have intervals from repeated or sampled runs.
"""

import argparse
import math
import re
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TextIO

from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.outcome import Outcome
from dodo_dsl.report import results
from dodo_dsl.spec.model import Goal
from dodo_dsl.terminal import json_text, printable

LEVEL = 0.95
"""Of the intervals."""
_REPETITION = re.compile(r"(?:\[(?:run|report)=\d+\])+\Z")
_SAMPLE = re.compile(r"(\[|,)sample=\d+,.*\]\Z")
_DIGITS = 12


@dataclass(frozen=True)
class TestScore:
    """The runs of one test: the score of each that was judged, 0 of a failed one, and how many ended without answer."""

    scores: tuple[float, ...]
    failed: int = 0
    errors: int = 0

    @property
    def mean(self) -> float:
        """0 if no run was judged."""
        return statistics.fmean(self.scores) if self.scores else 0.0

    @property
    def failure_rate(self) -> float:
        """Share of the judged runs that failed; 1 if none was judged, because nothing speaks for the application."""
        return self.failed / len(self.scores) if self.scores else 1.0


@dataclass(frozen=True)
class TeamScore:
    """A team with its tests by name, all those that any team ran; no ``interval`` without two judged runs of each."""

    name: str
    tests: Mapping[str, TestScore]
    place: int = 0
    """Teams without a difference share one."""

    @property
    def score(self) -> float:
        return statistics.fmean(test.mean for test in self.tests.values())

    @property
    def failure_rate(self) -> float:
        """Mean over the tests."""
        return statistics.fmean(test.failure_rate for test in self.tests.values())

    @property
    def order(self) -> tuple[float, float]:
        """Fewer failures first, and among equal ones the higher score."""
        return round(self.failure_rate, _DIGITS), -round(self.score, _DIGITS)

    @property
    def interval(self) -> tuple[float, float] | None:
        """By Student's t for a mean of means, degrees of freedom after Welch and Satterthwaite, rounded down."""
        tests = self.tests.values()
        if any(len(test.scores) < 2 for test in tests):
            return None
        variances = [statistics.variance(test.scores) / len(test.scores) / len(tests) ** 2 for test in tests]
        total = sum(variances)
        if total == 0:
            return self.score, self.score
        spread = sum((v / total) ** 2 / (len(t.scores) - 1) for v, t in zip(variances, tests, strict=True))
        wide = students_t(max(1, math.floor(1 / spread + 1e-9))) * math.sqrt(total)
        return max(0.0, self.score - wide), min(1.0, self.score + wide)


def students_t(freedom: int) -> float:
    """What half of LEVEL lies below and above 0, by bisection.

    After Abramowitz and Stegun, Handbook of Mathematical Functions, 26.7.3 and 26.7.4.
    """
    low, high = 0.0, 13.0
    while (middle := (low + high) / 2) not in (low, high):
        angle = math.atan(middle / math.sqrt(freedom))
        is_odd = freedom % 2
        term, total = math.cos(angle) if is_odd else 1.0, 0.0
        for step in range(2 + is_odd, freedom + 1, 2):
            total += term
            term *= math.cos(angle) ** 2 * (step - 1) / step
        share = math.sin(angle) * total
        share = 2 / math.pi * (angle + share) if is_odd else share
        low, high = (middle, high) if share < LEVEL else (low, middle)
    return low


def test_name(outcome: Outcome) -> str:
    """The instance's name, without the number of a repeated run or the sample of its ranges."""
    return _SAMPLE.sub(lambda found: "]" if found[1] == "," else "", _REPETITION.sub("", outcome.name))


def run_score(outcome: Outcome) -> float:
    """The weighted mean of the goals' scores, 0 of a failed run; without goals a passed run scores 1.

    Where several evaluators have a check of that name the worst counts.
    """
    if outcome.outcome != "passed":
        return 0.0
    weight = sum(goal.weight for goal in outcome.goals)
    return sum(goal.weight * _goal_score(goal, outcome) for goal in outcome.goals) / weight if weight else 1.0


def _goal_score(goal: Goal, outcome: Outcome) -> float:
    return min((goal.score(c["value"]) for c in outcome.checks if c["name"] == goal.check), default=0.0)


def rank(results: Mapping[str, Sequence[Outcome]]) -> list[TeamScore]:
    """Teams by their names, best first."""
    names = sorted({test_name(outcome) for outcomes in results.values() for outcome in outcomes})
    teams = []
    for name, outcomes in results.items():
        runs = {test: [outcome for outcome in outcomes if test_name(outcome) == test] for test in names}
        teams.append(TeamScore(name, {test: _test(each) for test, each in runs.items()}))
    teams.sort(key=lambda team: (*team.order, team.name))
    orders = [team.order for team in teams]
    return [replace(team, place=orders.index(team.order) + 1) for team in teams]


def _test(runs: Sequence[Outcome]) -> TestScore:
    judged = [run for run in runs if run.outcome != "error"]
    failed = sum(run.outcome == "failed" for run in judged)
    return TestScore(tuple(map(run_score, judged)), failed, len(runs) - len(judged))


VERSION = 1
METHOD = (
    "score: mean over the tests, of each the mean over its runs, 0 for one that failed; "
    "interval: 95 % by Student's t from repeated or sampled runs; failed tests rank below everything"
)
HEAD = ("rank", "team", "score", "95 % interval", "failed", "no answer", "runs")


def as_text(ranking: Sequence[TeamScore]) -> str:
    """A table, and how it is made."""
    rows = [HEAD, *map(cells, ranking)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEAD))]
    lines = ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    return "\n".join([*lines, "", METHOD]) + "\n"


def as_markdown(ranking: Sequence[TeamScore]) -> str:
    """The same table for a page."""
    rows = [HEAD, ("---",) * len(HEAD), *(map(_escaped, cells(team)) for team in ranking)]
    return "\n".join([*(f"| {' | '.join(row)} |" for row in rows), "", METHOD]) + "\n"


def as_json(ranking: Sequence[TeamScore]) -> str:
    """All scores, run by run."""
    teams = list(map(_document, ranking))
    return json_text({"dodo": "ranking", "version": VERSION, "level": LEVEL, "method": METHOD, "teams": teams})


def _document(team: TeamScore) -> dict[str, Any]:
    tests = {
        name: {"score": test.mean, "runs": test.scores, "failed": test.failed, "errors": test.errors}
        for name, test in team.tests.items()
    }
    about = {"rank": team.place, "team": team.name, "score": team.score, "interval": team.interval}
    return about | {"failure_rate": team.failure_rate, "tests": tests}


def cells(team: TeamScore) -> tuple[str, ...]:
    """What a table says of a team, under HEAD."""
    interval = "single runs" if team.interval is None else f"{team.interval[0]:.3f} to {team.interval[1]:.3f}"
    tests = team.tests.values()
    runs = sum(len(test.scores) + test.errors for test in tests)
    failed = f"{sum(test.failed > 0 for test in tests)} of {len(tests)}"
    unanswered = sum(not test.scores for test in tests)
    return (
        str(team.place), printable(team.name), f"{team.score:.3f}", interval, failed, str(unanswered), str(runs)
    )  # fmt: skip


def _escaped(cell: str) -> str:
    return "".join(f"\\{c}" if c in "\\|*_`[]<>" else c for c in cell)


def load_teams(words: Sequence[str]) -> dict[str, list[Outcome]]:
    """The outcomes of each team, of FILE, FOLDER or NAME=FILE; raises UsageError and ResultsError.

    Files with the same written name are one team's; names of folders have to differ.
    """
    teams: dict[str, list[Outcome]] = {}
    of_folders: set[str] = set()
    for word in words:
        written, _, file = word.partition("=")
        if Path(word).exists() or not file:
            written, file = "", word
        path = Path(file) / results.FILE_NAME if Path(file).is_dir() else Path(file)
        name = written or path.resolve().parent.name
        if name in teams and (not written or name in of_folders):
            raise UsageError(f"two results are of team '{name}'; name them, as in {name}-2={word}")
        if not written:
            of_folders.add(name)
        teams.setdefault(name, []).extend(results.load(path))
    if empty := next((name for name, outcomes in teams.items() if not outcomes), None):
        raise UsageError(f"the results of team '{empty}' have no test")
    _check_goals(teams)
    return teams


def _check_goals(teams: dict[str, list[Outcome]]) -> None:
    """Raises UsageError if two runs of a test have other goals: their scores say nothing about each other."""
    known: dict[str, tuple[str, tuple[Goal, ...]]] = {}
    for team, outcomes in teams.items():
        for outcome in outcomes:
            test = test_name(outcome)
            other, goals = known.setdefault(test, (team, outcome.goals))
            if goals != outcome.goals:
                both = f"of '{other}' and '{team}'" if other != team else f"of '{team}'"
                raise UsageError(f"the goals of test '{test}' differ between the results {both}; run it again for one")


EXAMPLES = """examples:
  dodo rank a/results.json b/results.json         teams 'a' and 'b', named by their folders
  dodo rank old=one/dodo-report new=two/dodo-report
  dodo rank a=1/results.json a=2/results.json b=3/results.json     two runs of team 'a'
  dodo rank */results.json --format markdown

Goals are under 'goals' in a test and never change a verdict; results.json has them. A passed run scores the weighted
mean of its goals from 0 to 1 (1 without goals), a failed one 0. A team's score is the mean over all tests that any team
ran, of each the mean over its runs. Teams are ordered by the share of runs that failed, then by score. A test
without an answer, because it is missing or ended in error each time, counts as failed. Intervals are by Student's t
(Welch and Satterthwaite) from repeated runs (dodo run --repeat), which in lockstep are always the same, or from runs at
samples of the ranges of the tests (dodo run --samples).
"""


FORMATS = {"text": as_text, "markdown": as_markdown, "json": as_json}


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("results", nargs="+", metavar="RESULTS", help="results.json or its folder, or NAME=FILE")
    parser.add_argument("--format", choices=tuple(FORMATS), default="text", help="format of the table (default: text)")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    stdout.write(FORMATS[options.format](rank(load_teams(options.results))))
    return Exit.OK
