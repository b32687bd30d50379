"""The log lines of all services of a test by its time, with errors and warnings marked."""

import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dodo_dsl import log_times
from dodo_dsl.opendlv import regular_file
from dodo_dsl.report.viewer.encoded import shown
from dodo_dsl.report.viewer.recorded import FAR, MICROSECONDS, RecordedTest

MOST_LINES = 4000
"""Of all logs together; of more, those of the middle are left out."""
_MOST_BYTES = 1 << 20
"""Of each end of a log."""
_MOST_TEXT = 600
_ESCAPES = re.compile(r"\x1b(\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(\x07|\x1b\\)|[@-Z\\-_])")
_ERROR = re.compile(
    r"^\W*([Ee]rror|[Ff]atal|[Cc]ritical|[Pp]anic|[Aa]borted)\b|\b(ERROR|FATAL|CRITICAL|PANIC)\b|[Ee]rror:|^Traceback"
    r"|\b\w+(Error|Exception)\b|terminate called|[Ss]egmentation fault|assert\w* .*failed",
)
_WARNING = re.compile(r"\bwarn(ing)?\b", re.I)
_APPLICATION = "application"
READY, INFO = "ready", "info"
"""What services of DoDo say before a test begins, and the level of this and of all that they say in passing."""
_IN_PASSING = re.compile(r"^(ready$|[\w.-]+: (INFO|DEBUG)\b)")


class LogLine(NamedTuple):
    """A line at a time in s of the test, before it below zero, None if that is unknown."""

    time: float | None
    service: str
    level: str
    text: str


def merged(folder: Path, test: RecordedTest) -> dict[str, Any]:
    """All lines below ``folder``, the logs of a test: ``services`` by name, and how many lines were ``left``out."""
    lines = [line for log in sorted(folder.glob("*.log")) for line in _lines(log, test)]
    timed = [line.time for line in lines if line.time is not None]
    if min(map(abs, timed), default=0.0) > FAR:  # no message has both clocks; a test begins once all are ready
        begin = max(
            (each.time for each in lines if each.text == READY and each.level == INFO and each.time), default=min(timed)
        )
        lines = [line._replace(time=line.time and line.time - begin) for line in lines]
    lines.sort(key=lambda line: float("inf") if line.time is None else line.time)
    left = max(len(lines) - MOST_LINES, 0)
    if left:
        lines = [*lines[: MOST_LINES // 2], *lines[-MOST_LINES // 2 :]]
    names = sorted({line.service for line in lines})
    rows = [
        [None if time is None else round(time, 4), names.index(name), level, text] for time, name, level, text in lines
    ]
    return {"services": [shown(name, 80) for name in names], "lines": rows, "left": left}


def _lines(log: Path, test: RecordedTest) -> Iterator[LogLine]:
    offsets, walls = log_times.read(log)
    times = _test_times(walls, test)
    layer, _, name = log.stem.partition(".")
    level = ""
    for offset, raw in _raw_lines(log):
        line = _ESCAPES.sub("", raw[: 4 * _MOST_TEXT].decode("utf-8", "replace")).rstrip("\r\n ")
        if line:
            level = _level(line, level)
            kind = INFO if not level and layer != _APPLICATION and _IN_PASSING.match(line) else level
            part = bisect_right(offsets, offset) - 1
            yield LogLine(times[part] if part >= 0 else None, name or layer, kind, shown(line, _MOST_TEXT))


def _raw_lines(log: Path) -> Iterator[tuple[int, bytes]]:
    """Begin and end of a log, line by line with their offsets."""
    try:
        with regular_file.opened(log) as file:
            size = file.seek(0, 2)
            parts = [(0, size)] if size <= 2 * _MOST_BYTES else [(0, _MOST_BYTES), (size - _MOST_BYTES, size)]
            for begin, end in parts:
                file.seek(begin)
                offset = begin
                for line in file.read(end - begin).split(b"\n"):
                    yield offset, line
                    offset += len(line) + 1
    except OSError:
        return


def _test_times(walls: Sequence[int], test: RecordedTest) -> list[float]:
    """Times of the machine in the test's: within a test as messages show it, else by its clock, or beyond ``FAR``."""
    if not len(test.walls):
        return [(wall - test.begin) / MICROSECONDS for wall in walls]
    arrived = np.array(walls, np.float64)
    inside = np.where(arrived > test.walls[-1], test.duration, np.interp(arrived, test.walls, test.moments))
    before = (arrived - test.walls[0]) / MICROSECONDS
    times: list[float] = np.where(before < 0, before, np.minimum(inside, test.duration)).tolist()
    return times


def _level(line: str, before: str) -> str:
    """``error``, ``warning`` or nothing; lines that go on where an error began are errors, too."""
    if _ERROR.search(line[:_MOST_TEXT]):
        return "error"
    if before == "error" and line.startswith((" ", "\t")):
        return "error"
    return "warning" if _WARNING.search(line[:_MOST_TEXT]) else ""
