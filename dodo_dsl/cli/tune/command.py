"""dodo tune: find values of the application's parameters with which it passes by more."""

import argparse
import asyncio
import math
import time
from pathlib import Path
from typing import TextIO, cast

from dodo_dsl import atomic
from dodo_dsl.cli import selection
from dodo_dsl.cli.errors import require_extra
from dodo_dsl.cli.exits import Exit
from dodo_dsl.cli.numbers import minutes, positive, seed
from dodo_dsl.cli.report import REPORT
from dodo_dsl.cli.run.forecast import expectation
from dodo_dsl.cli.run.loading import Loading, loading
from dodo_dsl.cli.run.uninterrupted import UninterruptedStream, more_descriptors, undisturbed
from dodo_dsl.cli.search.drives import Interrupted, Kept, end_like_interrupt
from dodo_dsl.cli.search.progress import SearchProgress
from dodo_dsl.cli.tune import result
from dodo_dsl.cli.tune.course import FINALISTS, TuneCourse
from dodo_dsl.cli.tune.study import TuneStudy, tune_study
from dodo_dsl.cli.tune.trials import RigFailure, Trials
from dodo_dsl.run.backends import Processes
from dodo_dsl.run.rigs.attendance import RigSession
from dodo_dsl.run.schedule import schedule
from dodo_dsl.run.work_folder import reap_folders, work_folder
from dodo_dsl.search.itinerary import Itinerary
from dodo_dsl.search.store import opened
from dodo_dsl.terminal import json_text, printable

EXAMPLES = """examples:
  dodo tune sil-my-drive                        50 choices of the application's parameters
  dodo tune 'sil-*' --mean --minutes 30         the best mean over several tests, in half an hour
  dodo tune sil-my-drive --samples 8            also at 8 samples of the test's ranges, 'vary'
  dodo tune hil-my-drive --minutes 20 --metres 50    on its rig, which drives 50 m at most

The same command again goes on where an earlier one was interrupted, or with more runs.

exit codes: 0 the best values pass, 1 they fail, 2 wrong usage or spec, 3 not even the defaults were driven, or a rig
failed, 130 interrupted
"""

FOLDER, STORE, RESULT, VALUES = "tune", "tune.sqlite", "tune.json", "best.env"
_RUNS = 50
_SWEPT = 1
"""Drives of the sweep in a generation: a tuning looks for the best values, and not for an even cover."""
_MOST_RUNS = 1 << 14
_RIG_MINUTES, _RIG_METRES = 30.0, 100.0


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("tests", metavar="TEST", nargs="+", help="name, pattern or path of tests")
    parser.add_argument(
        "--runs", type=positive, metavar="N",
        help=f"choices of values, each driven in all tests and samples (default: {_RUNS}, unless --minutes is given)",
    )  # fmt: skip
    parser.add_argument(
        "--minutes", type=minutes, metavar="M",
        help=f"tune no longer than that; held-out samples follow (default on a rig: {_RIG_MINUTES:g})",
    )  # fmt: skip
    parser.add_argument(
        "--metres", type=positive, metavar="M",
        help=f"a rig drives no longer way than that, with 2.4 m for each way to its start (default: {_RIG_METRES:g})",
    )  # fmt: skip
    parser.add_argument("--mean", action="store_true", help="the mean margin counts, not the worst one")
    parser.add_argument(
        "--samples", type=positive, default=0, metavar="N",
        help="drive each test at N samples of its ranges, too; N others decide among the best, N more judge the result",
    )  # fmt: skip
    parser.add_argument("--seed", type=seed, default=0, metavar="S", help="seed of values and samples (default: 0)")
    parser.add_argument(
        "-j", "--jobs", type=positive, metavar="N", help="concurrent drives (default: as many as the cores allow)"
    )
    parser.add_argument("--isolation", choices=("network", "host"), help="replaces the specs' isolation")
    parser.add_argument(
        "--report", type=Path, default=REPORT, metavar="DIR",
        help="the result is kept in DIR/tune (default: dodo-report)",
    )  # fmt: skip
    selection.add_application(parser)


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    require_extra("this", "search")
    end_like_interrupt()
    more_descriptors()
    stdout = cast(TextIO, UninterruptedStream(stdout))
    reap_folders()
    options.backend = "process"
    report = options.report.resolve() / FOLDER
    with work_folder() as folder, loading(options, folder.lease.descriptor) as load:
        study = tune_study(options, folder.path, stdout)
        with opened(report, study.key, STORE) as store:
            runs = min(options.runs or (_MOST_RUNS if options.minutes else _RUNS), _MOST_RUNS)
            itinerary = Itinerary(study.space, runs, options.seed, seeks_best=True, swept=_SWEPT)
            course = TuneCourse(study, itinerary, store, options.mean)
            end = _tune(options, course, folder.path, report, load, stdout)
            if course.done:
                _write(course, report, stdout)
    if course.done:
        stdout.write(f"values: {options.report / FOLDER / VALUES}\n")
    if isinstance(end, RigFailure):
        stdout.write(printable(f"the rig failed: {end}; the same command goes on from here") + "\n")
        return Exit.ERROR
    if end is not None:
        stdout.write("interrupted: the same command goes on from here\n")
        return Exit.INTERRUPTED
    if not course.done:
        return Exit.ERROR
    return Exit.PROBLEMS if course.best.margin < 0 else Exit.OK


def _write(course: TuneCourse, report: Path, stdout: TextIO) -> None:
    with undisturbed():
        atomic.write_text(report / RESULT, json_text(result.document(course)))
        atomic.write_text(report / VALUES, result.env(course))
    stdout.writelines(f"{line}\n" for line in result.table(course))


def _tune(
    options: argparse.Namespace, course: TuneCourse, work: Path, report: Path, load: Loading, stdout: TextIO
) -> BaseException | None:
    """What ended it early: an interrupt, or a rig."""
    study = course.study
    deployment = study.checked.deployment
    session = RigSession()
    processes = Processes(deployment.cids, options.isolation, (load.descriptor,), [deployment.root], load.take, session)
    backends = Kept(processes)
    order = schedule(options.jobs, expectation(backends.name))
    if rigs := study.rigs:
        options.minutes = options.minutes or _RIG_MINUTES
        options.metres = options.metres or _RIG_METRES
        said = f"on rig {', '.join(rigs)}: at most {options.minutes:g} min, and {options.metres:g} m of way"
        stdout.write(printable(said) + "\n")
    deadline = time.monotonic() + options.minutes * 60 if options.minutes else None
    total = _drives(study, course.itinerary.runs) if options.runs or not deadline else None
    progress = SearchProgress(stdout, total, deadline)
    trials = Trials(study.checked, course.store, backends, order, progress, work, report / "drives", deadline)
    trials.metres, trials.session = options.metres or math.inf, session
    try:
        return asyncio.run(_follow(course, trials))
    finally:
        progress.close()


def _drives(study: TuneStudy, runs: int) -> int:
    """At most: defaults and choices in all scenarios, the finals, and both in those held out."""
    return (runs + 1) * len(study.scenarios) + FINALISTS * len(study.deciding) + 2 * len(study.held_out)


async def _follow(course: TuneCourse, trials: Trials) -> BaseException | None:
    try:
        await course.follow(trials)
    except (Interrupted, KeyboardInterrupt, RigFailure) as end:
        return end
    finally:
        trials.backends.end()
    return None
