"""dodo report: write the report of a finished run again."""

import argparse
from pathlib import Path
from typing import TextIO

from dodo_dsl.cli.exits import Exit
from dodo_dsl.report import results
from dodo_dsl.report.report_folder import write_summaries

EXAMPLES = """examples:
  dodo report dodo-report       index.html, junit.xml and metrics.txt from its results.json
"""


REPORT = Path("dodo-report")
"""Where reports go unless a command line names another folder."""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", metavar="DIR", type=Path, nargs="?", default=REPORT,
                        help="folder of the report (default: dodo-report)")  # fmt: skip


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    outcomes = results.load(options.folder / results.FILE_NAME)
    write_summaries(options.folder, outcomes)
    stdout.write(f"report: {options.folder / 'index.html'}\n")
    return Exit.OK
