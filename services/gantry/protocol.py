"""The rig's serial protocol (Table 4.1): ``$COMMAND:ARG1,ARG2,...`` out, ``$ARG1,ARG2,...`` back, a line each.

Numbers are in SI units and radians. Answers do not say to what: three numbers are POSITION's, one is STATUS's,
``$LIMITS:...`` is LIMITS', and ``$ERROR:code`` says why a line was not obeyed.
"""

import math
import re
from dataclasses import dataclass
from enum import StrEnum

from services.gantry.rig_table import LIMITS, Error, Source, Status

LONGEST = 96
"""Bytes of the longest line that can be an answer."""
FARTHEST = 10.0
"""A position farther from the middle (m, rad) was garbled."""

_NUMBER = r"[-+]?[0-9]{1,9}(?:\.[0-9]{1,9})?"
_ANSWER = re.compile(rf"\$(?:(?P<word>ERROR|LIMITS):)?(?P<numbers>{_NUMBER}(?:,{_NUMBER})*)\r?")


class Word(StrEnum):
    GOTO = "GOTO"
    RUN = "RUN"
    STOP = "STOP"
    CALIBRATE = "CALIBRATE"
    POSITION = "POSITION"
    STATUS = "STATUS"
    LIMITS = "LIMITS"
    SETLIMITS = "SETLIMITS"
    FORGET = "FORGET"


SENTENCES = {
    Status.LIMIT: "touched a limit switch and stopped",
    Status.STALL: "lost steps because a motor stalled",
    Status.HOT: "has a motor driver that is too hot",
    Status.NOT_CALIBRATED: "is not calibrated and does not know its position",
    Status.WATCHDOG: "got no command for 500 ms and braked by itself",
    Status.FAULT: "reports a fault",
}
"""What a status means that ends a test, with the rig as subject."""
LATCHED = frozenset({Status.LIMIT, Status.STALL, Status.HOT, Status.FAULT})
"""Faults for which the firmware has stopped the rig; it refuses to move until STOP acknowledges them."""


@dataclass(frozen=True)
class Position:
    """Where the rig measures itself to be: m from the middle, forward and to the left, and rad from forward."""

    x: float
    y: float
    yaw: float


@dataclass(frozen=True)
class Limits:
    """The limits that hold or are being written, in the order of LIMITS, and where they are from."""

    values: tuple[float, ...]
    source: Source


@dataclass(frozen=True)
class Refusal:
    code: int

    @property
    def is_garbled(self) -> bool:
        """Whether the line came damaged, which noise on it explains."""
        return self.code in (Error.UNKNOWN, Error.COUNT, Error.NUMBER, Error.DAMAGED)

    def __str__(self) -> str:
        names = [error.name for error in Error if error == self.code]
        return f"$ERROR:{self.code} ({names[0] if names else 'unknown to this version'})"


Answer = Position | Status | Refusal | Limits


def command(word: Word, *arguments: float) -> bytes:
    """A command as its line, numbers with six decimals; raises ValueError for one that is not finite."""
    if not all(map(math.isfinite, arguments)):
        raise ValueError(f"{word} takes finite numbers, not {', '.join(map(str, arguments))}")
    numbers = ",".join(f"{round(a, 6) + 0.0:.6f}" for a in arguments)
    return (f"${word}:{numbers}\n" if arguments else f"${word}\n").encode("ascii")


def answer(line: str) -> Answer | None:
    """The answer in a line without its end; None for any other line."""
    match = _ANSWER.fullmatch(line)
    if match is None:
        return None
    texts = match["numbers"].split(",")
    numbers = [float(text) for text in texts]
    if match["word"] == "ERROR":
        return Refusal(int(texts[0])) if len(texts) == 1 and texts[0].isdigit() else None
    if match["word"] == "LIMITS":
        *values, source = numbers
        fits = len(values) == len(LIMITS) and min(values) > 0 and source in set(Source)
        return Limits(tuple(values), Source(int(source))) if fits else None
    if len(numbers) == 3 and max(map(abs, numbers)) <= FARTHEST:
        return Position(*numbers)
    return Status(int(texts[0])) if texts in [[str(int(status))] for status in Status] else None


class LineReader:
    """Splits incoming bytes into answers; other lines are counted in ``garbage``."""

    def __init__(self) -> None:
        self.garbage = 0
        self._rest = b""
        self._overlong = False

    def feed(self, data: bytes) -> list[Answer]:
        """The answers that these bytes complete; of a line only what begins with its last ``$`` counts."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        found = [self._answer(line) for line in lines]
        if len(self._rest) > LONGEST:
            self._rest, self._overlong = b"", True
        return [one for one in found if one is not None]

    def _answer(self, line: bytes) -> Answer | None:
        overlong, self._overlong = self._overlong or len(line) > LONGEST, False
        begin = max(line.rfind(b"$"), 0)
        found = None if overlong else answer(line[begin:].decode("ascii", "replace"))
        self.garbage += found is None and bool(line.strip())
        return found
