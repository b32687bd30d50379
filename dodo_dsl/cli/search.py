"""dodo search: look for the conditions under which the application fails a test."""

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from dodo_dsl import atomic, package_data
from dodo_dsl.cli.errors import Exit, UsageError, require_extra
from dodo_dsl.cli.numbers import minutes, positive
from dodo_dsl.cli.search_session import INTERRUPTED, SearchSession, add_common, session
from dodo_dsl.cli.uninterrupted import undisturbed
from dodo_dsl.search.findings import Findings, document, failures_of, lines
from dodo_dsl.search.search_loop import SearchLoop
from dodo_dsl.search.shrinking import Shrinker
from dodo_dsl.search.store import Store, opened
from dodo_dsl.search.study import Study, refuse_search, search_study
from dodo_dsl.terminal import json_text

EXAMPLES = """examples:
  dodo search sil-my-drive                 100 drives within the test's ranges
  dodo search sil-my-drive --runs 1000 -j 4
  dodo search sil-my-drive --minutes 30    as many drives as fit into half an hour
  dodo search sil-my-drive --save          keep a test of each failure among your tests
  dodo search sil-my-drive --until-failure --runs 400    end as soon as one is found
  dodo search sil-my-drive --sweep         only measure how often it fails
  dodo search sil-my-drive --storage postgresql://dodo@server/dodo    together with other machines
  dodo search sil-my-drive --storage /mnt/shared/search.journal    the same by a file

The same command continues where an earlier one was interrupted, or adds drives.

exit codes: 0 no drive failed, 1 some failed, 2 wrong usage or spec, 3 none could be judged, 130 interrupted
"""

FILE_NAME, STORE = "search.json", "search.journal"
MAIN = "main"
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
        "--sweep", action="store_true", help="no drives at the ends of ranges: all measure how often it fails"
    )
    parser.add_argument(
        "--minutes",
        type=minutes,
        metavar="M",
        help="stop looking for failures after that time; reducing them takes further drives",
    )
    parser.add_argument("--until-failure", action="store_true", help="end soon after the first failure, and reduce it")
    parser.add_argument("--save", action="store_true", help="save a test of each failure next to TEST")
    add_common(parser, "DIR/search/TEST")
    parser.add_argument(
        "--storage", metavar="URL",
        help="database or file whose drives all workers share (default: a file in DIR/search/TEST)"
    )  # fmt: skip
    parser.add_argument("--study", metavar="NAME", default=MAIN, help=f"which search of TEST (default: {MAIN})")
    parser.add_argument(
        "--finish", action="store_true", help="do not search further: reduce the failures found, and write the result"
    )


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    require_extra("this", "search")
    if options.storage and options.storage.startswith("postgres"):
        require_extra("--storage", "storage")
    with session(options, stdout) as own:
        study = _study(own)
        slug = study.test.spec.slug
        report = options.report.resolve() / "search" / slug
        place = str(report / STORE) if options.storage is None else options.storage
        with opened(place, f"{slug} {options.study}", study.key) as store:
            findings, interrupted = _search(own, study, store, report)
    with undisturbed():
        atomic.write_text(report / FILE_NAME, json_text(document(findings)))
    own.stdout.writelines(f"{line}\n" for line in lines(findings))
    own.stdout.write(f"search: {options.report / 'search' / slug / FILE_NAME}\n")
    if interrupted:
        own.stdout.write(INTERRUPTED)
        return Exit.INTERRUPTED
    if not findings.judged:
        return Exit.ERROR
    fails_at_nominal = findings.nominal is not None and findings.nominal.outcome == "failed"
    return Exit.PROBLEMS if findings.failures or fails_at_nominal else Exit.OK


def _study(own: SearchSession) -> Study:
    """The study of the options; raises UsageError and NotSearchable where the test cannot be searched."""
    checked = own.selected([own.options.test])
    if checked.ok:
        refuse_search(own.options.test, checked.tests)
    return search_study(checked, own.compiled(checked), own.work, own.options.seed)


def _search(own: SearchSession, study: Study, store: Store, report: Path) -> tuple[Findings, bool]:
    """What was found, and whether an interrupt ended it."""
    options, deadline = own.options, _deadline(own.options)
    runs = min(options.runs or (_MOST_BY_TIME if options.minutes else _RUNS), _MOST_RUNS)
    total = runs + 1 if options.runs or not deadline else None
    with own.drives(study, store, report / "drives", deadline, total) as drives:
        drives.a_core = 1 if options.storage else drives.a_core
        loop = SearchLoop(
            study.test.spec, study.space, runs, options.seed, drives, not options.sweep, options.until_failure
        )
        shrinker = Shrinker(study, drives, report, runs + 1, _registry(study) if options.save else None)
        interrupted = drives.run(_follow(loop, shrinker))
    return replace(loop.findings(), shrunk=tuple(shrinker.found)), interrupted


def _deadline(options: argparse.Namespace) -> float | None:
    if options.finish:
        return time.monotonic()
    return time.monotonic() + options.minutes * 60 if options.minutes else None


def _registry(study: Study) -> Path:
    """The folder of the user's own tests; raises UsageError for a test that ships."""
    root = study.test.spec.location.root
    if package_data.is_shipped(root, study.checked.deployment.root):
        raise UsageError("'--save' is for your own tests: copy this one with 'dodo new NAME --extends'")
    return root


async def _follow(loop: SearchLoop, shrinker: Shrinker) -> None:
    await loop.follow()
    failed = loop.failed() if loop.corners else []
    await shrinker.shrink(failures_of([drive for _, drive in failed]), failed)
