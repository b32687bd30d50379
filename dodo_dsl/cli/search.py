"""dodo search: look for the conditions under which the application fails a test."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from dodo_dsl import atomic, package_data
from dodo_dsl.cli.errors import Exit, UsageError, require_extra
from dodo_dsl.cli.numbers import positive
from dodo_dsl.cli.search_session import INTERRUPTED, SearchSession, add_common, session
from dodo_dsl.cli.uninterrupted import undisturbed
from dodo_dsl.search.findings import Findings, document, failures_of, lines
from dodo_dsl.search.search_loop import SearchLoop
from dodo_dsl.search.shrinking import Shrinker
from dodo_dsl.search.store import Store, opened
from dodo_dsl.search.study import Study, refuse_search, search_study
from dodo_dsl.terminal import json_text, printable

EXAMPLES = """examples:
  dodo search sil-my-drive                 100 drives within the test's ranges
  dodo search sil-my-drive --runs 1000 -j 4
  dodo search sil-my-drive --save          keep a test of each failure among your tests
  dodo search sil-my-drive --until-failure --runs 400    end as soon as one is found
  dodo search sil-my-drive --storage postgresql://dodo@server/dodo    together with other machines
  dodo search sil-my-drive --storage /mnt/shared/search.journal    the same by a file

The same command continues where an earlier one was interrupted, or adds drives.

exit codes: 0 no drive failed, 1 some failed, 2 wrong usage or spec, 3 none could be judged, 130 interrupted
"""

FILE_NAME, STORE = "search.json", "search.journal"
MAIN = "main"
_RUNS = 100
_MOST_RUNS = 1 << 20


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("test", metavar="TEST", help="name or path of a test in lockstep with ranges, 'vary'")
    parser.add_argument("--runs", type=positive, metavar="N", default=_RUNS, help=f"drives (default: {_RUNS})")
    parser.add_argument("--until-failure", action="store_true", help="end soon after the first failure, and reduce it")
    parser.add_argument("--save", action="store_true", help="save a test of each failure next to TEST")
    add_common(parser, "DIR/search/TEST")
    parser.add_argument(
        "--storage", metavar="URL",
        help="database or file whose drives all workers share (default: a file in DIR/search/TEST)"
    )  # fmt: skip
    parser.add_argument("--study", metavar="NAME", default=MAIN, help=f"which search of TEST (default: {MAIN})")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    require_extra("this", "search")
    if options.storage and options.storage.startswith("postgres"):
        require_extra("--storage", "storage")
    with session(options, stdout) as own:
        checked = own.selected([options.test])
        if checked.ok:
            refuse_search(options.test, checked.tests)
        study = search_study(checked, own.compiled(checked), own.folder.path, options.seed)
        slug = study.test.spec.slug
        report = options.report.resolve() / "search" / slug
        place = str(report / STORE) if options.storage is None else options.storage
        with opened(place, f"{slug} {options.study}", study.key) as store:
            findings, interrupted = _search(own, study, store, report)
    with undisturbed():
        atomic.write_text(report / FILE_NAME, json_text(document(findings)))
    own.stdout.writelines(f"{printable(line)}\n" for line in lines(findings))
    own.stdout.write(f"search: {options.report / 'search' / slug / FILE_NAME}\n")
    if interrupted:
        own.stdout.write(INTERRUPTED)
        return Exit.INTERRUPTED
    if not findings.judged:
        return Exit.ERROR
    fails_at_nominal = findings.nominal is not None and findings.nominal.outcome == "failed"
    return Exit.PROBLEMS if findings.failures or fails_at_nominal else Exit.OK


def _search(own: SearchSession, study: Study, store: Store, report: Path) -> tuple[Findings, bool]:
    """What was found, and whether an interrupt ended it."""
    options = own.options
    runs = min(options.runs, _MOST_RUNS)
    registry = _registry(study) if options.save else None
    drives = own.drives(study, store, report / "drives", shared=options.storage is not None)
    loop = SearchLoop(study.test.spec, study.space, runs, options.seed, drives, options.until_failure)
    shrinker = Shrinker(study, drives, report, runs + 1, registry)

    async def follow() -> None:
        await loop.follow()
        failed = loop.failed()
        await shrinker.shrink(failures_of([drive for _, drive in failed]), failed)

    interrupted = drives.run(follow())
    return replace(loop.findings(), shrunk=tuple(shrinker.found)), interrupted


def _registry(study: Study) -> Path:
    """The folder of the user's own tests; raises UsageError for a test that ships."""
    root = study.test.spec.location.root
    if package_data.is_shipped(root, study.checked.deployment.root):
        raise UsageError("'--save' is for your own tests: copy this one with 'dodo new NAME --extends'")
    return root
