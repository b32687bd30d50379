"""Any number of reports in one new folder, in which every link works offline."""

import errno
from collections.abc import Iterator, Sequence
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.outcome import Outcome
from dodo_dsl.report import results
from dodo_dsl.report.distinct import JoinedTest, distinct
from dodo_dsl.report.given_report import GivenReport
from dodo_dsl.report.joined.copies import NotCopied, Room, copy_test, is_folder, left_out
from dodo_dsl.report.joined.drive_page import copy_page
from dodo_dsl.report.report_folder import OF_MACHINE, forget
from dodo_dsl.report.viewer import page
from dodo_dsl.report.viewer.names import DATA, SHARED


def join(reports: Sequence[GivenReport], out: Path) -> tuple[list[Outcome], list[str]]:
    """Copies results and files of the reports to ``out``, whose summaries are still to be written.

    Returns the outcomes, and sentences on what was renamed or left out. Raises OSError, NotReplaceable where ``out`` is
    anything but new, empty or an earlier report that is not among ``reports``; before that nothing is written.
    """
    tests = list(distinct(reports))
    outcomes = [test.outcome for test in tests]
    earlier = _earlier(out, reports, [outcome.slug for outcome in outcomes])
    with (atomic.files_into if out.exists() else atomic.new_folder)(out) as stage:
        sentences = [*_renamed(tests), *_copied(tests, stage)]
        (stage / results.FILE_NAME).write_text(results.to_json(outcomes), encoding="utf-8")
        if earlier is not None:
            forget(out, [])
            for name in OF_MACHINE:
                (out / name).unlink(missing_ok=True)
    return outcomes, sentences


def _earlier(out: Path, reports: Sequence[GivenReport], slugs: Sequence[str]) -> set[str] | None:
    """The slugs of the report that ``out`` replaces; None where there is no report."""
    if out.is_symlink():
        raise atomic.NotReplaceable(errno.ELOOP, "a symlink, which no output follows", str(out))
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return None
    place = out.resolve()
    if any(report.is_whole and report.folder.resolve().is_relative_to(place) for report in reports):
        raise _not_replaceable(out, "it holds a report that is to be joined")
    try:
        earlier = {outcome.slug for outcome in results.load(out / results.FILE_NAME)}
    except results.ResultsError:
        raise _not_replaceable(out, "neither a new or empty folder nor a report of DoDo") from None
    for path in (out / SHARED, *(out / slug for slug in earlier)):
        if path.exists() and not path.is_dir():
            raise _not_replaceable(path, "not a folder of a report")
    for path in (out / SHARED, *(out / slug for slug in slugs if slug not in earlier)):
        if path.is_symlink():
            raise _not_replaceable(path, "a symlink, which no output follows")
        if path.name != SHARED and path.exists() and not (path.is_dir() and not any(path.iterdir())):
            raise _not_replaceable(path, f"not of the report in '{out}'")
    return earlier


def _not_replaceable(path: Path, why: str) -> atomic.NotReplaceable:
    return atomic.NotReplaceable(errno.EEXIST, f"{why}; nothing is replaced", str(path))


def _renamed(tests: Sequence[JoinedTest]) -> Iterator[str]:
    for test in tests:
        if test.is_renamed:
            yield f"'{test.slug}' of {test.report.file} is called '{test.outcome.slug}', as there is one before it"


def _copied(tests: Sequence[JoinedTest], stage: Path) -> Iterator[str]:
    room, has_pages = Room(), False
    for test in tests:
        source, target = test.report.folder / test.slug, stage / test.outcome.slug
        if test.report.is_whole and source.is_symlink():
            yield left_out(source, "it is a symlink")
        if not test.report.is_whole or not is_folder(source):
            continue
        yield from copy_test(source, target, room)
        try:
            has_pages |= copy_page(source, target, test.outcome, room)
        except NotCopied as problem:
            yield f"{source / DATA} is left out with its page: {problem}"
    if has_pages:
        page.write_shared(stage)
