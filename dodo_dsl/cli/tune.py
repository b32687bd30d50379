"""dodo tune: find values of the application's parameters that increase the test margin."""

import argparse
import time
from pathlib import Path
from typing import TextIO

from dodo_dsl import atomic
from dodo_dsl.cli.errors import Exit, require_extra
from dodo_dsl.cli.numbers import minutes, positive
from dodo_dsl.cli.search_session import INTERRUPTED, SearchSession, add_common, session
from dodo_dsl.cli.uninterrupted import undisturbed
from dodo_dsl.search.store import Store, opened
from dodo_dsl.search.study import Study, tune_study
from dodo_dsl.search.tuning import Tuning, document, env, scenarios, table
from dodo_dsl.terminal import json_text

EXAMPLES = """examples:
  dodo tune sil-my-drive                        50 choices of the application's parameters
  dodo tune 'sil-*' --mean --minutes 30         the best mean over several tests, in half an hour
  dodo tune sil-my-drive --samples 8            also at 8 samples of the test's ranges, 'vary'

The same command continues where an earlier one was interrupted, or adds runs.

exit codes: 0 the best values pass, 1 they fail, 2 wrong usage or spec, 3 not even the defaults were driven, 130
interrupted
"""

FOLDER, STORE, RESULT, VALUES = "tune", "tune.journal", "tune.json", "best.env"
_RUNS = 50
_MOST_RUNS = 1 << 14


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("tests", metavar="TEST", nargs="+", help="name, pattern or path of tests")
    parser.add_argument(
        "--runs", type=positive, metavar="N",
        help=f"choices of values, each driven in all tests and samples (default: {_RUNS}, unless --minutes is given)",
    )  # fmt: skip
    parser.add_argument(
        "--minutes", type=minutes, metavar="M", help="tune no longer than that; held-out samples follow"
    )  # fmt: skip
    parser.add_argument("--mean", action="store_true", help="optimise the mean margin, not the worst one")
    parser.add_argument(
        "--samples", type=positive, default=0, metavar="N",
        help="drive each test at N samples of its ranges, too; N others judge the result",
    )  # fmt: skip
    add_common(parser, "DIR/tune")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    require_extra("this", "search")
    report = options.report.resolve() / FOLDER
    with session(options, stdout) as own:
        checked = own.selected(options.tests)
        study = tune_study(checked, own.compiled(checked), own.work, options.samples)
        with opened(str(report / STORE), FOLDER, study.key) as store:
            tuning, interrupted = _tune(own, study, store, report)
            if tuning.done:
                _write(tuning, report, own.stdout)
    if tuning.done:
        own.stdout.write(f"values: {options.report / FOLDER / VALUES}\n")
    if interrupted:
        own.stdout.write(INTERRUPTED)
        return Exit.INTERRUPTED
    if not tuning.done:
        return Exit.ERROR
    return Exit.PROBLEMS if tuning.best.margin < 0 else Exit.OK


def _tune(own: SearchSession, study: Study, store: Store, report: Path) -> tuple[Tuning, bool]:
    """The tuning, and whether an interrupt ended it early."""
    options = own.options
    runs = min(options.runs or (_MOST_RUNS if options.minutes else _RUNS), _MOST_RUNS)
    driven = scenarios(study.checked.tests, options.samples, options.seed)
    deadline = time.monotonic() + options.minutes * 60 if options.minutes else None
    total = driven.most_drives(runs) if options.runs or not deadline else None
    with own.drives(study, store, report / "drives", deadline, total) as drives:
        tuning = Tuning(study.space, driven, runs, options.seed, drives, options.mean)
        return tuning, drives.run(tuning.follow())


def _write(tuning: Tuning, report: Path, stdout: TextIO) -> None:
    with undisturbed():
        atomic.write_text(report / RESULT, json_text(document(tuning)))
        atomic.write_text(report / VALUES, env(tuning))
    stdout.writelines(f"{line}\n" for line in table(tuning))
