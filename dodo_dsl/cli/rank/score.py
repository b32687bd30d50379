"""Scores of teams from their results, with intervals from repeated or sampled runs."""

import math
import re
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from dodo_dsl.cli.stats.student_t import quantile
from dodo_dsl.outcome import Outcome
from dodo_dsl.spec.goals import Goal

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
        """0 where no run was judged."""
        return statistics.fmean(self.scores) if self.scores else 0.0

    @property
    def failure_rate(self) -> float:
        """Share of the judged runs that failed; 1 where none was judged, as nothing speaks for the application."""
        return self.failed / len(self.scores) if self.scores else 1.0


@dataclass(frozen=True)
class TeamScore:
    """A team with its tests by name, all those that any team ran.

    ``interval`` is that of the score, None where a test has fewer than two judged runs.
    """

    name: str
    tests: Mapping[str, TestScore]
    score: float
    interval: tuple[float, float] | None
    failure_rate: float
    """Mean over the tests."""


@dataclass(frozen=True)
class Ranked:
    """A team with its place; teams without a difference share one."""

    place: int
    team: TeamScore


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


def rank(results: Mapping[str, Sequence[Outcome]]) -> list[Ranked]:
    """Teams by their names, best first: fewer failures first, and among equal ones the higher score."""
    names = sorted({test_name(outcome) for outcomes in results.values() for outcome in outcomes})
    teams = [_team(name, outcomes, names) for name, outcomes in results.items()]
    teams.sort(key=lambda team: (*_key(team), team.name))
    keys = [_key(team) for team in teams]
    return [Ranked(keys.index(_key(team)) + 1, team) for team in teams]


def _key(team: TeamScore) -> tuple[float, float]:
    return round(team.failure_rate, _DIGITS), -round(team.score, _DIGITS)


def _team(name: str, outcomes: Iterable[Outcome], names: Sequence[str]) -> TeamScore:
    runs: dict[str, list[Outcome]] = {test: [] for test in names}
    for outcome in outcomes:
        runs[test_name(outcome)].append(outcome)
    tests = {test: _test(each) for test, each in runs.items()}
    score = statistics.fmean(test.mean for test in tests.values())
    failures = statistics.fmean(test.failure_rate for test in tests.values())
    return TeamScore(name, tests, score, _interval(score, list(tests.values())), failures)


def _test(runs: Sequence[Outcome]) -> TestScore:
    judged = [run for run in runs if run.outcome != "error"]
    failed = sum(run.outcome == "failed" for run in judged)
    return TestScore(tuple(map(run_score, judged)), failed, len(runs) - len(judged))


def _interval(score: float, tests: Sequence[TestScore]) -> tuple[float, float] | None:
    """By Student's t for a mean of means, degrees of freedom after Welch and Satterthwaite, rounded down."""
    if any(len(test.scores) < 2 for test in tests):
        return None
    variances = [statistics.variance(test.scores) / len(test.scores) / len(tests) ** 2 for test in tests]
    total = sum(variances)
    if total == 0:
        return score, score
    spread = sum((v / total) ** 2 / (len(t.scores) - 1) for v, t in zip(variances, tests, strict=True))
    wide = quantile((1 + LEVEL) / 2, max(1, math.floor(1 / spread + 1e-9))) * math.sqrt(total)
    return max(0.0, score - wide), min(1.0, score + wide)
