"""dodo rank: rank applications by the goals of their tests."""

import argparse
from collections.abc import Sequence
from typing import TextIO

from dodo_dsl.cli.exits import Exit
from dodo_dsl.cli.rank import teams
from dodo_dsl.cli.rank.output import as_json, as_markdown, as_text
from dodo_dsl.cli.rank.score import Ranked, rank

EXAMPLES = """examples:
  dodo rank a/results.json b/results.json         teams 'a' and 'b', named by their folders
  dodo rank old=one/dodo-report new=two/dodo-report
  dodo rank a=1/results.json a=2/results.json b=3/results.json     two runs of team 'a'
  dodo rank */results.json --format markdown
  dodo rank */results.json --format html > ranking.html

Goals stand under 'goals' in a test and never change a verdict; results.json has them. A passed run scores the weighted
mean of its goals from 0 to 1 (1 without goals), a failed one 0. A team's score is the mean over all tests that any team
ran, of each the mean over its runs. Teams are ordered by the share of runs that failed, then by score. A test
without an answer, because it is missing or ended in error each time, counts as failed. Intervals are by Student's t
(Welch and Satterthwaite) from repeated runs (dodo run --repeat), which in lockstep are always the same, or from runs at
samples of the ranges of the tests (dodo run --samples).
"""


def _as_html(ranking: Sequence[Ranked]) -> str:
    from dodo_dsl.cli.rank.page import as_page

    return as_page(ranking)


FORMATS = {"text": as_text, "markdown": as_markdown, "json": as_json, "html": _as_html}


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("results", nargs="+", metavar="RESULTS", help="results.json or its folder, or NAME=FILE")
    parser.add_argument("--format", choices=tuple(FORMATS), default="text", help="format of the table (default: text)")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    stdout.write(FORMATS[options.format](rank(teams.load(options.results))))
    return Exit.OK
