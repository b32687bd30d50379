"""What changed, as Markdown for the note of a merge request: short, and no text of others in it is markup."""

import errno
from collections.abc import Iterator, Sequence
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.opendlv import regular_file
from dodo_dsl.report.changes import words
from dodo_dsl.report.changes.check_change import Direction
from dodo_dsl.report.changes.comparison import Comparison, Kind, TestChange
from dodo_dsl.terminal import printable

FILE_NAME = "changes.md"
MOST_LINES = 60
_MARK = "<!-- written by dodo report -->"
"""The first line, by which the file is known as one of DoDo."""
_MOST_TEXT = 300
_SECTION = 3
"""Lines of a section without its items: a blank one, the title, and how many more there are."""
_TESTS: tuple[Kind, ...] = ("newly failing", "still failing", "new", "gone", "fixed")
_CHECKS: tuple[Direction, ...] = ("worse", "better", "different")


def to_markdown(comparison: Comparison) -> str:
    """At most ``MOST_LINES`` lines; each section shows some of what it has, the first ones more."""
    sections = [(kind.capitalize(), [_test(test) for test in comparison.of(kind)]) for kind in _TESTS]
    for direction in _CHECKS:
        items = [_check(test, words.change(check), check.name) for test, check in comparison.checks(direction)]
        sections.append((f"Checks: {direction}", items))
    sections = [(title, items) for title, items in sections if items]
    head = [_MARK, f"**DoDo:** {comparison.in_words()}, compared with {code(comparison.other)}"]
    shares = _shares([len(items) for _, items in sections], MOST_LINES - len(head) - _SECTION * len(sections))
    body = [line for (title, items), most in zip(sections, shares, strict=True) for line in _lines(title, items, most)]
    return "\n".join([*head, *body]) + "\n"


def write(folder: Path, comparison: Comparison | None) -> None:
    """Writes the file into a report, or without a comparison removes that of an earlier one; raises OSError."""
    path = folder / FILE_NAME
    is_there = path.is_symlink() or path.exists()
    if is_there and not _is_ours(path):
        if comparison is not None:
            raise atomic.NotReplaceable(errno.EEXIST, "not written by DoDo; nothing is replaced", str(path))
    elif comparison is not None:
        atomic.write_text(path, to_markdown(comparison))
    elif is_there:
        path.unlink()


def code(text: str) -> str:
    """Text of others as code: one line in which nothing is a link, a mention, a command or the end of the code."""
    line = printable(text[:_MOST_TEXT]) + ("…" if len(text) > _MOST_TEXT else "")
    return f"`{line.replace('`', chr(0x2BC)) or ' '}`"


def _is_ours(path: Path) -> bool:
    try:
        return not path.is_symlink() and regular_file.text(path).startswith(_MARK)
    except (OSError, ValueError):
        return False


def _shares(sizes: Sequence[int], most: int) -> list[int]:
    """How many items each section shows: one after the other gets one more, as long as there are any."""
    shares = [0] * len(sizes)
    while most > 0 and shares != [*sizes]:
        for number, size in enumerate(sizes):
            if most > 0 and shares[number] < size:
                shares[number] += 1
                most -= 1
    return shares


def _lines(title: str, items: Sequence[str], most: int) -> Iterator[str]:
    yield ""
    yield f"**{title} ({len(items)})**"
    yield from (f"- {item}" for item in items[:most])
    if len(items) > most:
        yield f"- and {len(items) - most} more"


def _test(test: TestChange) -> str:
    return f"{code(test.latest.name)}: {words.outcomes(test)}, {code(test.latest.reason)}"


def _check(test: TestChange, change: str, name: str) -> str:
    return f"{code(test.latest.name)} {code(name)}: {code(change)}"
