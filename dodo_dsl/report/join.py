"""Any number of reports in one folder, in which every link works offline.

Copies are of files that reports hold, and no symlinks. A report's ``drive.js`` is a script, and may come from an
untrusted source: only the value that it assigns is kept, checked to be data, with this DoDo's page and scripts.
"""

import errno
import io
import json
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dodo_dsl import atomic
from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import Outcome
from dodo_dsl.report import results
from dodo_dsl.report.files import DATA, VIDEOS, is_of_a_test
from dodo_dsl.report.next_report import next_report
from dodo_dsl.report.results import GivenReport, JoinedTest, distinct
from dodo_dsl.report.viewer import page
from dodo_dsl.report.viewer.encoded import VARIABLE, script, shown


class NotCopied(ValueError):
    """Why a file is left out, in a few words."""


def join(reports: Sequence[GivenReport], out: Path) -> tuple[list[Outcome], list[str]]:
    """Copies the files of the reports' tests to ``out``, whose summaries are still to be written.

    Returns the outcomes, and sentences on what was renamed or left out. Raises OSError, NotReplaceable if ``out`` is
    anything but new, empty or an earlier report that is not among ``reports``; before that nothing is written.
    """
    _refuse(out, reports)
    tests, sentences = list(distinct(reports)), list[str]()
    out.mkdir(parents=True, exist_ok=True)
    slugs = [test.outcome.slug for test in tests]
    for slug in slugs:
        if (out / slug).is_symlink():
            raise _not_replaceable(out / slug, "a symlink, which no output follows")
    with next_report(out, slugs) as target:
        for test in tests:
            if test.slug != test.outcome.slug:
                name = f"'{test.slug}' of {test.report.file}"
                sentences.append(f"{name} is called '{test.outcome.slug}', as there is one before it")
            source = test.report.folder / test.slug
            if test.report.is_whole and not source.is_symlink():
                _copy_test(source, target.folder / test.outcome.slug, test, sentences)
        target.take_place(slugs)
    return [test.outcome for test in tests], sentences


def _refuse(out: Path, reports: Sequence[GivenReport]) -> None:
    if out.is_symlink():
        raise atomic.NotReplaceable(errno.ELOOP, "a symlink, which no output follows", str(out))
    place = out.resolve()
    if any(report.is_whole and report.folder.resolve().is_relative_to(place) for report in reports):
        raise _not_replaceable(out, "it holds a report that is to be joined")
    if out.exists() and not (out.is_dir() and not any(out.iterdir())):
        try:
            results.load(out / results.FILE_NAME)
        except results.ResultsError:
            raise _not_replaceable(out, "neither a new or empty folder nor a report of DoDo") from None


def _not_replaceable(path: Path, why: str) -> atomic.NotReplaceable:
    return atomic.NotReplaceable(errno.EEXIST, f"{why}; nothing is replaced", str(path))


def _copy_test(source: Path, target: Path, test: JoinedTest, sentences: list[str]) -> None:
    """Copies a test's files; raises OSError."""
    for folder, _, names in os.walk(source):
        for path in sorted(Path(folder) / name for name in names):
            name = path.relative_to(source).as_posix()
            try:
                if name == DATA:
                    text = script(read_document(path, test.outcome))
                    target.mkdir(parents=True, exist_ok=True)
                    (target / name).write_text(text, encoding="ascii")
                    page.write_html(target)
                elif is_of_a_test(name):
                    with _opened(path) as file:
                        (target / name).parent.mkdir(parents=True, exist_ok=True)
                        with (target / name).open("xb") as copy:
                            shutil.copyfileobj(file, copy)
            except NotCopied as problem:
                sentences.append(f"{path} is left out{' with its page' if name == DATA else ''}: {problem}")


def _opened(path: Path) -> io.FileIO:
    try:
        return regular_file.opened(path, os.O_NOFOLLOW)
    except OSError as error:
        raise NotCopied("it is a symlink" if error.errno == errno.ELOOP else str(error.strerror)) from None


_BEGIN, _END = f"var {VARIABLE} = ", ";\n"


def read_document(path: Path, outcome: Outcome) -> dict[str, Any]:
    """The value that a ``drive.js`` assigns, by the name of ``outcome``; raises NotCopied for anything else."""
    with _opened(path) as file:
        data = file.read(regular_file.MOST_BYTES + 1)
    if len(data) > regular_file.MOST_BYTES:
        raise NotCopied(f"it is larger than {regular_file.MOST_BYTES} bytes")
    try:
        text = data.decode("ascii")
        if not (text.startswith(_BEGIN) and text.endswith(_END)):
            raise NotCopied("it holds more than the data of a drive")
        document: dict[str, Any] = json.loads(text[len(_BEGIN) : -len(_END)])
        if document["version"] != page.VERSION:
            raise NotCopied(f"it is of version {shown(document['version'], 20)}, expected {page.VERSION}")
        if not {video["file"] for video in document["videos"]} <= {*VIDEOS}:
            raise NotCopied("it is not the data of a drive")
        document["test"] |= {"name": shown(outcome.name), "slug": shown(outcome.slug)}
        script(document)  # raises for numbers such as 1e999
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise error if isinstance(error, NotCopied) else NotCopied("it is not the data of a drive") from error
    return document
