"""dodo report: draw reports again, join them into one, and show what changed."""

import argparse
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

from dodo_dsl.cli.errors import Exit, UsageError, of_outcomes
from dodo_dsl.outcome import Outcome
from dodo_dsl.report import results
from dodo_dsl.report.comparison import change_lines, compare
from dodo_dsl.report.report_folder import write_summaries
from dodo_dsl.report.results import GivenReport, read_given
from dodo_dsl.terminal import printable

EXAMPLES = """examples:
  dodo report dodo-report            index.html, junit.xml and metrics.txt from its results.json
  dodo report jobs/* -o joined       the reports of several jobs as one, with all their files
  dodo report --gitlab -o joined     in a job of GitLab: those of the child pipelines' jobs, from its API
  dodo report --against ../main/dodo-report    what changed since that report, also on the page

exit codes: 0 drawn, 2 wrong usage or no report; with --against 1 some tests failed, 3 some ended in error
"""


REPORT = Path("dodo-report")
"""Where reports go unless a command line names another folder."""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", metavar="DIR", type=Path, nargs="*", default=[],
                        help="folders of reports, or their results.json (default: dodo-report)")  # fmt: skip
    parser.add_argument("-o", "--output", metavar="OUT", type=Path,
                        help="join the reports into this folder: a new or empty one, or an earlier report")  # fmt: skip
    parser.add_argument("--gitlab", action="store_true",
                        help="in a job of GitLab: join the reports of the pipeline's child pipelines")  # fmt: skip
    parser.add_argument("--against", metavar="OTHER", type=Path,
                        help="show what changed since another report: its folder or results.json")  # fmt: skip


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    other = read_given(options.against) if options.against else None
    with tempfile.TemporaryDirectory() as folder:
        fetched = _child_reports(Path(folder), stdout) if options.gitlab else []
        folders = options.folder if options.folder or fetched else [REPORT]
        output = options.output or (REPORT if options.gitlab else None)
        reports = [*map(read_given, folders), *fetched]
        target, outcomes = _drawn(reports, output, stdout)
    comparison = compare(outcomes, other) if other else None
    circumstances = results.joined(reports)
    write_summaries(target, outcomes, circumstances, comparison)
    if comparison:
        stdout.writelines(f"{line}\n" for line in change_lines(comparison))
    stdout.write(f"report: {target / 'index.html'}\n")
    return of_outcomes(outcome.outcome for outcome in outcomes) if comparison else Exit.OK


def _child_reports(folder: Path, stdout: TextIO) -> list[GivenReport]:
    """The reports of the child pipelines of this job's, kept in ``folder``."""
    from dodo_dsl.report import child_jobs

    reports, sentences = child_jobs.fetch(child_jobs.of_job(os.environ), folder)
    stdout.writelines(f"{printable(sentence)}\n" for sentence in sentences)
    if not reports:
        raise UsageError("no job of a child pipeline has a report")
    return reports


def _drawn(reports: Sequence[GivenReport], out: Path | None, stdout: TextIO) -> tuple[Path, Sequence[Outcome]]:
    """The folder whose summaries are to be written, and the outcomes that they show."""
    if out is None:
        report, *others = reports
        if others:
            raise UsageError(f"{len(reports)} reports are given; name the folder to join them into with -o")
        if not report.is_whole:
            raise UsageError(f"'{report.file}' is not called {results.FILE_NAME}; name a folder for the report with -o")
        return report.folder, report.outcomes
    from dodo_dsl.report.join import join

    outcomes, sentences = join(reports, out)
    stdout.writelines(f"{printable(sentence)}\n" for sentence in sentences)
    return out, outcomes
