"""dodo rank: rank applications by the goals of their tests."""

import argparse
import re
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.outcome import Outcome
from dodo_dsl.report import results
from dodo_dsl.spec.model import Goal
from dodo_dsl.terminal import json_text, printable

_REPETITION = re.compile(r"(?:\[(?:run|report)=\d+\])+\Z")
_SAMPLE = re.compile(r"(\[|,)sample=\d+,.*\]\Z")
_DIGITS = 12


@dataclass(frozen=True)
class TestScore:
    """The runs of one test: the score of each that was judged, 0 of a failed one, and how many ended without answer."""

    runs: tuple[float, ...]
    failed: int
    errors: int

    @property
    def score(self) -> float:
        """0 if no run was judged."""
        return statistics.fmean(self.runs) if self.runs else 0.0

    @property
    def failure_rate(self) -> float:
        """Share of the judged runs that failed; 1 if none was judged, because nothing speaks for the application."""
        return self.failed / len(self.runs) if self.runs else 1.0


@dataclass(frozen=True)
class TeamScore:
    """A team with its tests by name, all those that any team ran."""

    name: str
    tests: Mapping[str, TestScore]

    @property
    def score(self) -> float:
        return statistics.fmean(test.score for test in self.tests.values())

    @property
    def failure_rate(self) -> float:
        """Mean over the tests."""
        return statistics.fmean(test.failure_rate for test in self.tests.values())

    @property
    def order(self) -> tuple[float, float]:
        """Fewer failures first, and among equal ones the higher score."""
        return round(self.failure_rate, _DIGITS), -round(self.score, _DIGITS)


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


def rank(results: Mapping[str, Sequence[Outcome]]) -> list[tuple[int, TeamScore]]:
    """Teams by their names, best first, each with its place; those without a difference share one."""
    names = sorted({test_name(outcome) for outcomes in results.values() for outcome in outcomes})
    teams = []
    for name, outcomes in results.items():
        runs = {test: [outcome for outcome in outcomes if test_name(outcome) == test] for test in names}
        teams.append(TeamScore(name, {test: _test(each) for test, each in runs.items()}))
    teams.sort(key=lambda team: (*team.order, team.name))
    orders = [team.order for team in teams]
    return [(orders.index(team.order) + 1, team) for team in teams]


def _test(runs: Sequence[Outcome]) -> TestScore:
    judged = [run for run in runs if run.outcome != "error"]
    failed = sum(run.outcome == "failed" for run in judged)
    return TestScore(tuple(map(run_score, judged)), failed, len(runs) - len(judged))


VERSION = 1
METHOD = "score: mean over the tests, of each the mean over its runs; failed tests rank below everything"
HEAD = ("rank", "team", "score", "failed", "no answer", "runs")


def as_text(ranking: Sequence[tuple[int, TeamScore]]) -> str:
    """A table, and how it is made."""
    rows = [HEAD, *(_cells(place, team) for place, team in ranking)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    return "\n".join([*lines, "", METHOD]) + "\n"


def _cells(place: int, team: TeamScore) -> tuple[str, ...]:
    tests = team.tests.values()
    failed = f"{sum(test.failed > 0 for test in tests)} of {len(tests)}"
    unanswered = sum(not test.runs for test in tests)
    runs = sum(len(test.runs) + test.errors for test in tests)
    return str(place), printable(team.name), f"{team.score:.3f}", failed, str(unanswered), str(runs)


def as_json(ranking: Sequence[tuple[int, TeamScore]]) -> str:
    """All scores, run by run."""
    teams = [
        {
            "rank": place,
            "team": team.name,
            "score": team.score,
            "failure_rate": team.failure_rate,
            "tests": {
                name: {"score": test.score, "runs": test.runs, "failed": test.failed, "errors": test.errors}
                for name, test in team.tests.items()
            },
        }
        for place, team in ranking
    ]
    return json_text({"dodo": "ranking", "version": VERSION, "method": METHOD, "teams": teams})


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
                both = f"'{other}' and '{team}'" if other != team else f"'{team}'"
                raise UsageError(f"the goals of test '{test}' differ between the results of {both}; run it again")


EXAMPLES = """examples:
  dodo rank a/results.json b/results.json         teams 'a' and 'b', named by their folders
  dodo rank old=one/dodo-report new=two/dodo-report
  dodo rank a=1/results.json a=2/results.json b=3/results.json     two runs of team 'a'

A passed run scores the weighted mean of its goals from 0 to 1 (1 without goals), a failed one 0. Teams are ordered by
the share of runs that failed, then by score. A test without an answer counts as failed.
"""


FORMATS = {"text": as_text, "json": as_json}


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("results", nargs="+", metavar="RESULTS", help="results.json or its folder, or NAME=FILE")
    parser.add_argument("--format", choices=tuple(FORMATS), default="text", help="format of the table (default: text)")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    stdout.write(FORMATS[options.format](rank(load_teams(options.results))))
    return Exit.OK
