"""A ranking as text, Markdown and JSON."""

from collections.abc import Sequence
from typing import Any

from dodo_dsl.cli.rank.score import LEVEL, Ranked, TeamScore
from dodo_dsl.terminal import json_text, printable

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
