"""dodo rank: rank applications by the goals of their tests.

Scores of teams have intervals from repeated or sampled runs. A ranking is text, Markdown, JSON, or a page: one file,
without scripts, with a bar for each score and its interval.
"""

import argparse
import math
import re
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from markupsafe import Markup

from dodo_dsl import __version__
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.cli.stats import student_t_quantile
from dodo_dsl.outcome import Outcome
from dodo_dsl.report import results
from dodo_dsl.report.overview import environment, source_hash, style
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
    """A team with its tests by name, all those that any team ran.

    ``interval`` is that of the score, None if a test has fewer than two judged runs.
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
    wide = student_t_quantile((1 + LEVEL) / 2, max(1, math.floor(1 / spread + 1e-9))) * math.sqrt(total)
    return max(0.0, score - wide), min(1.0, score + wide)


VERSION = 1
METHOD = (
    "score: mean over the tests, of each the mean over its runs, 0 for one that failed; "
    "interval: 95 % by Student's t from repeated or sampled runs; failed tests rank below everything"
)
HEAD = ("rank", "team", "score", "95 % interval", "failed", "no answer", "runs")


def as_text(ranking: Sequence[Ranked]) -> str:
    """A table, and how it is made."""
    rows = [HEAD, *(cells(each) for each in ranking)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEAD))]
    lines = ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    return "\n".join([*lines, "", METHOD]) + "\n"


def as_markdown(ranking: Sequence[Ranked]) -> str:
    """The same table for a page."""
    rows = [HEAD, ("---",) * len(HEAD), *(tuple(map(_escaped, cells(each))) for each in ranking)]
    return "\n".join([*(f"| {' | '.join(row)} |" for row in rows), "", METHOD]) + "\n"


def as_json(ranking: Sequence[Ranked]) -> str:
    """All scores, run by run."""
    document = {
        "dodo": "ranking",
        "version": VERSION,
        "level": LEVEL,
        "method": METHOD,
        "teams": [_document(each) for each in ranking],
    }
    return json_text(document)


def _document(ranked: Ranked) -> dict[str, Any]:
    team = ranked.team
    tests = {
        name: {"score": test.mean, "runs": test.scores, "failed": test.failed, "errors": test.errors}
        for name, test in team.tests.items()
    }
    return {
        "rank": ranked.place,
        "team": team.name,
        "score": team.score,
        "interval": team.interval,
        "failure_rate": team.failure_rate,
        "tests": tests,
    }


def cells(ranked: Ranked) -> tuple[str, ...]:
    """What a table says of a team, under HEAD."""
    team = ranked.team
    interval = "single runs" if team.interval is None else f"{team.interval[0]:.3f} to {team.interval[1]:.3f}"
    tests = team.tests.values()
    runs = sum(len(test.scores) + test.errors for test in tests)
    failed = f"{sum(test.failed > 0 for test in tests)} of {len(tests)}"
    return str(ranked.place), printable(team.name), f"{team.score:.3f}", interval, failed, _unanswered(team), str(runs)


def _unanswered(team: TeamScore) -> str:
    """The number of tests without a judged run."""
    return str(sum(not test.scores for test in team.tests.values()))


def _escaped(cell: str) -> str:
    return "".join(f"\\{c}" if c in "\\|*_`[]<>" else c for c in cell)


def load_teams(words: Sequence[str]) -> dict[str, list[Outcome]]:
    """The outcomes of each team, of FILE, FOLDER or NAME=FILE; raises UsageError and ResultsError.

    Files with the same written name are one team's; names of folders have to differ.
    """
    teams: dict[str, list[Outcome]] = {}
    folders: dict[str, str] = {}
    for word in words:
        name, path = _named(word)
        if not name:
            name = path.resolve().parent.name
            if name in folders or name in teams:
                raise UsageError(f"two results are of team '{name}'; name them, as in {name}-2={word}")
            folders[name] = word
        elif name in folders:
            raise UsageError(f"two results are of team '{name}', as '{folders[name]}' is in a folder of that name")
        teams.setdefault(name, []).extend(results.load(path))
    if empty := next((name for name, outcomes in teams.items() if not outcomes), None):
        raise UsageError(f"the results of team '{empty}' have no test")
    _check_goals(teams)
    return teams


def _named(word: str) -> tuple[str, Path]:
    """A team's name, empty if it is not written, and its file."""
    name, equals, file = word.partition("=")
    if equals and name and not Path(word).exists():
        word = file
    else:
        name = ""
    path = Path(word)
    return name, path / results.FILE_NAME if path.is_dir() else path


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
  dodo rank */results.json --format html > ranking.html

Goals are under 'goals' in a test and never change a verdict; results.json has them. A passed run scores the weighted
mean of its goals from 0 to 1 (1 without goals), a failed one 0. A team's score is the mean over all tests that any team
ran, of each the mean over its runs. Teams are ordered by the share of runs that failed, then by score. A test
without an answer, because it is missing or ended in error each time, counts as failed. Intervals are by Student's t
(Welch and Satterthwaite) from repeated runs (dodo run --repeat), which in lockstep are always the same, or from runs at
samples of the ranges of the tests (dodo run --samples).
"""


def _as_html(ranking: Sequence[Ranked]) -> str:
    pass

    return as_page(ranking)


FORMATS = {"text": as_text, "markdown": as_markdown, "json": as_json, "html": _as_html}


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("results", nargs="+", metavar="RESULTS", help="results.json or its folder, or NAME=FILE")
    parser.add_argument("--format", choices=tuple(FORMATS), default="text", help="format of the table (default: text)")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    stdout.write(FORMATS[options.format](rank(load_teams(options.results))))
    return Exit.OK


_WIDE, _HIGH = 180, 16
"""px of a bar from 0 to 1."""


def as_page(ranking: Sequence[Ranked]) -> str:
    """The table, and the mean score of each test."""
    look = style()
    return (
        environment()
        .get_template("report/ranking.html.j2")
        .render(
            ranking=ranking,
            tests=list(ranking[0].team.tests) if ranking else [],
            head=HEAD,
            cells=cells,
            bar=bar,
            in_words=in_words,
            method=METHOD,
            version=__version__,
            style=look,
            hash=source_hash,
        )
    )


def in_words(test: TestScore) -> str:
    """``0.912``, ``0.433, 2 of 8 failed`` or ``no answer``"""
    if not test.scores:
        return "no answer"
    return f"{test.mean:.3f}" + (f", {test.failed} of {len(test.scores)} failed" if test.failed else "")


def bar(team: TeamScore) -> Markup:
    """An SVG: the score as a bar from 0 to 1, its interval as a line."""
    colour = "var(--failed)" if team.failure_rate else "var(--passed)"
    middle = _HIGH / 2
    line = ""
    if team.interval:
        low, high = (_WIDE * end for end in team.interval)
        ends = f'x1="{low:.1f}" x2="{high:.1f}" y1="{middle:g}" y2="{middle:g}"'
        line = f'<line {ends} stroke="currentColor" stroke-width="2"/>'
    return Markup(  # noqa: S704  (numbers alone)
        f'<svg width="{_WIDE}" height="{_HIGH}" role="img" aria-label="{team.score:.3f}">'
        f'<rect width="{_WIDE}" height="{_HIGH}" fill="none" stroke="var(--line)"/>'
        f'<rect width="{_WIDE * team.score:.1f}" height="{_HIGH}" fill="{colour}" opacity="0.5"/>{line}</svg>'
    )
