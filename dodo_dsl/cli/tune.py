"""dodo tune: find values of the application's parameters that increase the test margin."""

import argparse
from typing import TextIO

from dodo_dsl import atomic
from dodo_dsl.cli.errors import Exit, require_extra
from dodo_dsl.cli.numbers import positive
from dodo_dsl.cli.search_session import INTERRUPTED, add_common, session
from dodo_dsl.cli.uninterrupted import undisturbed
from dodo_dsl.search.store import opened
from dodo_dsl.search.study import tune_study
from dodo_dsl.search.tuning import Tuning, document, env, lines, scenarios
from dodo_dsl.terminal import json_text

EXAMPLES = """examples:
  dodo tune sil-my-drive                        50 choices of the application's parameters
  dodo tune 'sil-*' --runs 100                  the best worst margin over several tests
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
        "--runs", type=positive, metavar="N", default=_RUNS,
        help=f"choices of values, each driven in all tests and samples (default: {_RUNS})",
    )  # fmt: skip
    parser.add_argument(
        "--samples", type=positive, default=0, metavar="N", help="drive each test at N samples of its ranges, too"
    )
    add_common(parser, "DIR/tune")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    require_extra("this", "search")
    report = options.report.resolve() / FOLDER
    with session(options, stdout) as own:
        checked = own.selected(options.tests)
        study = tune_study(checked, own.compiled(checked), own.folder.path, options.samples)
        with opened(str(report / STORE), FOLDER, study.key) as store:
            driven = scenarios(study.checked.tests, options.samples, options.seed)
            drives = own.drives(study, store, report / "drives")
            tuning = Tuning(study.space, driven, min(options.runs, _MOST_RUNS), options.seed, drives)
            interrupted = drives.run(tuning.follow())
    if tuning.done:
        with undisturbed():
            atomic.write_text(report / RESULT, json_text(document(tuning)))
            atomic.write_text(report / VALUES, env(tuning))
        own.stdout.writelines(f"{line}\n" for line in lines(tuning))
        own.stdout.write(f"values: {options.report / FOLDER / VALUES}\n")
    if interrupted:
        own.stdout.write(INTERRUPTED)
        return Exit.INTERRUPTED
    if not tuning.done:
        return Exit.ERROR
    return Exit.PROBLEMS if tuning.best.margin < 0 else Exit.OK
