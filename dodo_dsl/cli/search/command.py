"""dodo search: look for the conditions under which the application fails a test."""

import argparse
import asyncio
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TextIO, cast

from dodo_dsl import atomic, package_data
from dodo_dsl.cli import selection
from dodo_dsl.cli.errors import UsageError, require_extra
from dodo_dsl.cli.exits import Exit
from dodo_dsl.cli.numbers import minutes, positive, seed
from dodo_dsl.cli.report import REPORT
from dodo_dsl.cli.run.forecast import expectation
from dodo_dsl.cli.run.loading import Loading, loading
from dodo_dsl.cli.run.uninterrupted import UninterruptedStream, more_descriptors, undisturbed
from dodo_dsl.cli.search.course import Course
from dodo_dsl.cli.search.drives import Drives, Interrupted, Kept, end_like_interrupt
from dodo_dsl.cli.search.progress import SearchProgress
from dodo_dsl.cli.search.shrinking import Shrinker
from dodo_dsl.cli.search.study import Study, study_of
from dodo_dsl.cli.search.text import lines
from dodo_dsl.run.backends import Processes
from dodo_dsl.run.schedule import schedule
from dodo_dsl.run.work_folder import reap_folders, work_folder
from dodo_dsl.search import postgres
from dodo_dsl.search.findings import Findings, document, failures_of, find
from dodo_dsl.search.itinerary import Itinerary
from dodo_dsl.search.postgres import MAIN
from dodo_dsl.search.space import nominal, texts
from dodo_dsl.search.store import Store, opened
from dodo_dsl.terminal import json_text

EXAMPLES = """examples:
  dodo search sil-my-drive                 100 drives within the test's ranges
  dodo search sil-my-drive --runs 1000 -j 4
  dodo search sil-my-drive --minutes 30    as many drives as fit into half an hour
  dodo search sil-my-drive --save          keep a test of each failure among your tests
  dodo search sil-my-drive --until-failure --runs 400    end as soon as one is found
  dodo search sil-my-drive --sweep         only measure how often it fails
  dodo search sil-my-drive --storage postgresql://dodo@server/dodo    together with other machines

The same command again goes on where an earlier one was interrupted, or with more drives.

exit codes: 0 no drive failed, 1 some failed, 2 wrong usage or spec, 3 none could be judged, 130 interrupted
"""

FILE_NAME = "search.json"
_RUNS = 100
_MOST_RUNS = 1 << 20
_MOST_BY_TIME = 1 << 14
"""Drives of a search that only its time ends: more than four hours at one a second."""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("test", metavar="TEST", help="name or path of a test in lockstep with ranges, 'vary'")
    parser.add_argument(
        "--runs", type=positive, metavar="N", help=f"drives (default: {_RUNS}, unless --minutes is given)"
    )
    parser.add_argument(
        "--sweep", action="store_true", help="no drives near the worst ones: all tell how often it fails"
    )
    parser.add_argument(
        "--minutes",
        type=minutes,
        metavar="M",
        help="look for failures no longer than that; to shrink them takes further drives",
    )
    parser.add_argument("--until-failure", action="store_true", help="end soon after the first failure, and shrink it")
    parser.add_argument("--save", action="store_true", help="put a test of each failure beside TEST, to be kept")
    parser.add_argument("--seed", type=seed, default=0, metavar="S", help="seed of the search (default: 0)")
    parser.add_argument(
        "-j", "--jobs", type=positive, metavar="N", help="concurrent drives (default: as many as the cores allow)"
    )
    parser.add_argument("--isolation", choices=("network", "host"), help="replaces the spec's isolation")
    parser.add_argument(
        "--report", type=Path, default=REPORT, metavar="DIR",
        help="the search is kept in DIR/search/TEST (default: dodo-report)"
    )  # fmt: skip
    parser.add_argument(
        "--storage", metavar="URL",
        help="PostgreSQL database whose drives all workers share (default: a file in DIR/search/TEST)"
    )  # fmt: skip
    parser.add_argument("--study", metavar="NAME", help=f"with --storage: which search of TEST (default: {MAIN})")
    parser.add_argument(
        "--finish", action="store_true", help="look for nothing more: shrink the failures found, and write the result"
    )
    selection.add_application(parser)


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    require_extra("this", "search")
    if options.storage is None and options.study is not None:
        raise UsageError("--study names a search in a database: name that with --storage")
    if options.storage is not None:
        require_extra("--storage", "storage")
    end_like_interrupt()
    more_descriptors()
    stdout = cast(TextIO, UninterruptedStream(stdout))
    reap_folders()
    options.backend = "process"
    with work_folder() as folder, loading(options, folder.lease.descriptor) as load:
        study = study_of(options, folder.path, stdout)
        report = options.report.resolve() / "search" / study.test.spec.slug
        with _store(options, study, report) as store:
            findings, interrupted = _search(options, study, store, folder.path, report, load, stdout)
    with undisturbed():
        atomic.write_text(report / FILE_NAME, json_text(document(findings)))
    stdout.writelines(f"{line}\n" for line in lines(findings))
    stdout.write(f"search: {options.report / 'search' / study.test.spec.slug / FILE_NAME}\n")
    if interrupted:
        stdout.write("interrupted: the same command goes on from here\n")
        return Exit.INTERRUPTED
    if not findings.judged:
        return Exit.ERROR
    fails_at_nominal = findings.nominal is not None and findings.nominal.outcome == "failed"
    return Exit.PROBLEMS if findings.failures or fails_at_nominal else Exit.OK


def _store(options: argparse.Namespace, study: Study, report: Path) -> AbstractContextManager[Store]:
    if options.storage is None:
        return opened(report, study.key)
    return postgres.opened(options.storage, options.study or MAIN, study.test.spec.slug, study.key)


def _search(
    options: argparse.Namespace, study: Study, store: Store, work: Path, report: Path, load: Loading, stdout: TextIO
) -> tuple[Findings, bool]:
    """What was found, and whether an interrupt ended it."""
    runs = min(options.runs or (_MOST_BY_TIME if options.minutes else _RUNS), _MOST_RUNS)
    course = Course(Itinerary(study.space, runs, options.seed, not options.sweep), store, options.until_failure)
    deployment = study.checked.deployment
    backends = Kept(Processes(deployment.cids, options.isolation, (load.descriptor,), [deployment.root], load.take))
    order = schedule(options.jobs, expectation(backends.name))
    deadline = _deadline(options)
    with _shown(stdout, runs + 1 if options.runs or not deadline else None, deadline) as progress:
        drives = Drives(study.checked, study.test.spec, store, backends, order, progress, work, report, deadline)
        shrinker = Shrinker(drives, study.space, runs + 1, _registry(study) if options.save else None)
        interrupted = asyncio.run(_follow(course, shrinker, backends))
    at_nominal = store.get(texts(nominal(study.space)))
    swept, proposed = course.known(True), course.known(False)
    findings = find(study.test.spec.title, options.seed, study.space, at_nominal, swept, proposed)
    return replace(findings, ended_early=course.ended_early, shrunk=tuple(shrinker.found)), interrupted


def _deadline(options: argparse.Namespace) -> float | None:
    if options.finish:
        return time.monotonic()
    return time.monotonic() + options.minutes * 60 if options.minutes else None


def _registry(study: Study) -> Path:
    """The folder of the user's own tests; raises UsageError for a test that ships."""
    root = study.test.spec.location.root
    if package_data.is_shipped(root, study.checked.deployment.root):
        raise UsageError("'--save' is for tests of your own: copy this one with 'dodo new NAME --extends'")
    return root


async def _follow(course: Course, shrinker: Shrinker, backends: Kept) -> bool:
    """Whether it was interrupted."""
    try:
        await course.follow(shrinker.drives)
        failed = course.failed() if course.itinerary.proposes else []
        await shrinker.shrink(failures_of([drive for _, drive in failed]), failed)
    except (Interrupted, KeyboardInterrupt):
        return True
    finally:
        backends.end()
    return False


@contextmanager
def _shown(stream: TextIO, total: int | None, deadline: float | None) -> Iterator[SearchProgress]:
    progress = SearchProgress(stream, total, deadline)
    try:
        yield progress
    finally:
        progress.close()
