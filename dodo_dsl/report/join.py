"""Any number of reports in one new folder, in which every link works offline.

Copies are of files that reports hold: no symlinks, no more than fits. A report's ``drive.js`` is a script, and may come
from an untrusted source: only the value that it assigns is kept, checked to be data, with this DoDo's page and
scripts. For a comparison, the ways of another report's tests lie beside the pages of this one's, to be drawn over one
another.
"""

import contextlib
import errno
import io
import json
import os
import re
import stat
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dodo_dsl import atomic
from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.added_services import PICTURES_FILE, RECORDING, SNAPSHOT
from dodo_dsl.report import results, trajectory_svg
from dodo_dsl.report.comparison import Comparison, JoinedTest, TestChange, distinct
from dodo_dsl.report.report_folder import ATTEMPTS, OF_MACHINE, SANDBOX_LOG, TRAJECTORY, forget
from dodo_dsl.report.results import GivenReport
from dodo_dsl.report.viewer import names as viewer
from dodo_dsl.report.viewer import page
from dodo_dsl.report.viewer.encoded import VARIABLE, packed, script, shown, unpacked
from dodo_dsl.report.viewer.names import BEFORE, DATA, PAGE, SHARED, VIDEOS

MOST_BYTES = 16 << 30
"""Of all files of a joined report."""
MOST_FILES = 2000
"""In a folder; further ones are left out."""
_PART = 1 << 20
_FILES = {RECORDING, PICTURES_FILE, SNAPSHOT, TRAJECTORY, trajectory_svg.FILE_NAME, SANDBOX_LOG, *viewer.VIDEOS}
_LOG = re.compile(r"[^/\0]+\.(log|times|judged)")
_ATTEMPT = re.compile(r"[1-9][0-9]{0,3}")


class NotCopied(ValueError):
    """Why a file is left out, in a few words."""


@dataclass
class Room:
    """How many bytes may still be copied."""

    left: int = MOST_BYTES


def copy_test(source: Path, target: Path, room: Room) -> Iterator[str]:
    """Copies the files of a test, without its page, and yields a sentence on each that is left out; raises OSError.

    ``target`` is a folder that no one else writes to.
    """
    yield from _copy_folder(source, target, room)
    for attempt in _entries(source / ATTEMPTS):
        if _ATTEMPT.fullmatch(attempt.name) and is_folder(attempt):
            yield from _copy_folder(attempt, target / ATTEMPTS / attempt.name, room)
    for path in (source / viewer.LOGS, source / ATTEMPTS):
        if path.is_symlink():
            yield left_out(path, "it is a symlink")


def left_out(path: Path, why: object) -> str:
    return f"{path} is left out: {why}"


def is_folder(path: Path) -> bool:
    """Whether it is one itself, not a symlink to one."""
    try:
        return stat.S_ISDIR(path.lstat().st_mode)
    except (OSError, ValueError):
        return False


def opened(path: Path) -> io.FileIO:
    """A regular file to read; raises NotCopied for anything else, symlinks included."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    except OSError as error:
        raise NotCopied("it is a symlink" if error.errno == errno.ELOOP else str(error.strerror)) from None
    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        return io.FileIO(descriptor, "rb")
    os.close(descriptor)
    raise NotCopied("it is not a regular file")


def _copy_folder(source: Path, target: Path, room: Room) -> Iterator[str]:
    found = [path for path in _entries(source) if path.name in _FILES]
    found += [path for path in _entries(source / viewer.LOGS) if _LOG.fullmatch(path.name)]
    if len(found) > MOST_FILES:
        yield f"{source} has {len(found)} files, of which {len(found) - MOST_FILES} are left out"
    for path in found[:MOST_FILES]:
        try:
            _copy(path, target / path.relative_to(source), room)
        except NotCopied as problem:
            yield left_out(path, problem)


def _entries(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if is_folder(folder) else []


def _copy(source: Path, target: Path, room: Room) -> None:
    with opened(source) as file:
        size = os.fstat(file.fileno()).st_size
        if size > room.left:
            raise NotCopied(f"its {size} bytes would make the report larger than {MOST_BYTES >> 30} GiB")
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("xb") as copy:
            while size > 0 and (part := file.read(min(_PART, size))):
                copy.write(part)
                size -= len(part)
                room.left -= len(part)


_BEGIN, _END = f"var {VARIABLE} = ", ";\n"


def copy_page(source: Path, target: Path, outcome: Outcome, room: Room) -> bool:
    """Writes the page of a test, by its new name, where ``source`` has one; raises NotCopied and OSError."""
    if not (source / DATA).exists() and not (source / DATA).is_symlink():
        return False
    document = read_document(source / DATA)
    document["test"] = {**document["test"], "name": shown(outcome.name), "slug": shown(outcome.slug)}
    try:
        text = script(document)
    except (ValueError, RecursionError):  # numbers such as 1e999
        raise NotCopied("it is not the data of a drive") from None
    if len(text) > room.left:
        raise NotCopied("the report would become too large")
    room.left -= len(text)
    target.mkdir(parents=True, exist_ok=True)
    (target / DATA).write_text(text, encoding="ascii")
    page.write_html(target)
    return True


def read_document(path: Path) -> dict[str, Any]:
    """The value that a ``drive.js`` assigns; raises NotCopied for anything else, and OSError."""
    with opened(path) as file:
        data = file.read(regular_file.MOST_BYTES + 1)
    if len(data) > regular_file.MOST_BYTES:
        raise NotCopied(f"it is larger than {regular_file.MOST_BYTES} bytes")
    try:
        text = data.decode("ascii")
        if not (text.startswith(_BEGIN) and text.endswith(_END)):
            raise NotCopied("it holds more than the data of a drive")
        document = page.of_today(json.loads(text[len(_BEGIN) : -len(_END)], parse_constant=_refuse))
        if document["version"] != page.VERSION:
            raise NotCopied(f"it is of version {shown(document['version'], 20)}, expected {page.VERSION}")
        if not isinstance(document["test"], dict) or not {*_videos(document)} <= {*VIDEOS}:
            raise NotCopied("it is not the data of a drive")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise error if isinstance(error, NotCopied) else NotCopied("it is not the data of a drive") from error
    return dict(document)


def _videos(document: Any) -> list[str]:
    return [video["file"] for video in document["videos"] if "file" in video]


def _refuse(constant: str) -> None:
    raise ValueError(constant)


def join(reports: Sequence[GivenReport], out: Path) -> tuple[list[Outcome], list[str]]:
    """Copies results and files of the reports to ``out``, whose summaries are still to be written.

    Returns the outcomes, and sentences on what was renamed or left out. Raises OSError, NotReplaceable if ``out`` is
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
    """The slugs of the report that ``out`` replaces; None if there is no report."""
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


BEFORE_VARIABLE = "dodoBefore"
FIELDS = ("x", "y", "qx", "qy", "qz", "qw")


def write_other_ways(folder: Path, comparison: Comparison | None, other: GivenReport | None) -> None:
    """Puts the other report's ways into ``folder``, a report, in place of an earlier comparison's; raises OSError."""
    for path in sorted(folder.glob(f"*/{BEFORE}")):
        path.unlink()
        page.write_html(path.parent)
    if comparison is None or other is None or not other.is_whole:
        return
    for test in comparison.tests:
        if test.before and test.after and (folder / test.after.slug / PAGE).is_file():
            way = _way(other.folder / test.before.slug, test)
            if way is not None:
                place = folder / test.after.slug
                atomic.write_text(place / BEFORE, script(way, BEFORE_VARIABLE))
                page.write_html(place)


def _way(source: Path, test: TestChange) -> dict[str, Any] | None:
    """The positions of a test in another report, which is untrusted; None if there are none."""
    if not is_folder(source):
        return None
    with contextlib.suppress(NotCopied, OSError, KeyError, TypeError, ValueError, StopIteration, AttributeError):
        document = read_document(source / DATA)
        frame = document["scene"]["frame"]
        channel = next(
            each
            for each in document["channels"]
            if (each["message"], each["sender"]) == (frame["message"], frame["sender"])
        )
        return _checked(channel, test)
    return None


def _checked(channel: Mapping[str, Any], test: TestChange) -> dict[str, Any]:
    fields = {field["name"]: unpacked(field["values"]) for field in channel["fields"] if field["name"] in FIELDS}
    times = unpacked(channel["times"])
    if {*fields} != {*FIELDS} or {len(values) for values in fields.values()} != {len(times)}:
        raise ValueError("no way")
    return {
        "outcome": shown(test.before.outcome if test.before else "", 20),
        "times": packed(times),
        "fields": [{"name": each, "values": packed(fields[each])} for each in FIELDS],
    }
