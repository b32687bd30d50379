"""A ranking as a page: one file, without scripts, with a bar for each score and its interval."""

from collections.abc import Sequence

from markupsafe import Markup

from dodo_dsl import __version__
from dodo_dsl.cli.rank.output import HEAD, METHOD, cells
from dodo_dsl.cli.rank.score import Ranked, TeamScore, TestScore
from dodo_dsl.report.suite.html import environment, source_hash, style

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
