"""What lets the application's time go on (``native/agent.c``). In a container the application may write there, too."""

import os
import select
import stat
import time
from pathlib import Path
from typing import Annotated

import msgspec

from services.clock.exchange import SLICE_S, ServiceSilent

PATIENCE_S = 60.0
"""Wall time in s for the agent to be there."""
_NS = 1000
_MOST_TEXT = 1 << 16
_Text = Annotated[str, msgspec.Meta(max_length=64)]
_Seconds = Annotated[float, msgspec.Meta(ge=0, lt=1e9)]


class Busy(msgspec.Struct):
    """A thread that has not waited for a while; ``service`` is -1 where it is not known. Times in s."""

    service: int = -1
    name: _Text = ""
    state: _Text = ""
    wall_s: _Seconds = 0.0
    processor_s: _Seconds = 0.0


class ProgramNote(msgspec.Struct):
    kind: _Text
    service: int
    name: _Text


class Report(msgspec.Struct):
    """All threads wait at ``now`` (ns of test time), one of them is ``busy``, or the page of the time is ``destroyed``.

    ``services`` are those that have had a process, ``gone`` those of them that have none any more. ``ran_s`` is what
    the application computed since the last time, ``has_ended`` whether processes of it have ended meanwhile, whose last
    part that lacks.
    """

    now: int | None = None
    busy: Busy | None = None
    destroyed: bool = False
    services: frozenset[int] = frozenset()
    gone: frozenset[int] = frozenset()
    notes: Annotated[tuple[ProgramNote, ...], msgspec.Meta(max_length=64)] = ()
    repeatable: bool = True
    ran_s: _Seconds = 0.0
    has_ended: bool = False


_decode = msgspec.json.Decoder(Report).decode


class TimeAgent:
    """The agent over its two FIFOs in ``folder``."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._command = self._reply = -1
        self._text = b""
        self._poll = select.poll()

    def open(self) -> None:
        """Wait until it is there, and hide the FIFOs from all others; raises ServiceSilent."""
        deadline = time.monotonic() + PATIENCE_S
        while not self._is_open():
            if time.monotonic() > deadline:
                raise ServiceSilent(f"nothing in {self._folder} lets the application's time go on (dodo-time)")
            time.sleep(SLICE_S)
        self._send("mine")

    def _is_open(self) -> bool:
        try:
            if self._reply < 0:
                self._reply = _opened(self._folder / "reply", os.O_RDONLY)
                self._poll.register(self._reply, select.POLLIN)
            self._command = _opened(self._folder / "command", os.O_WRONLY)
        except OSError:
            return False
        return True

    def run(self, until: int) -> None:
        """Let the application go on to a time of the test (us); raises ServiceSilent."""
        self._send(f"run {until * _NS}")

    def report(self, timeout: float) -> Report | None:
        """The next report, or None after ``timeout`` seconds; raises ServiceSilent."""
        if b"\n" not in self._text and self._poll.poll(timeout * 1000):
            data = os.read(self._reply, _MOST_TEXT)
            if not data:
                raise ServiceSilent(_ENDED)
            self._text = self._text[-_MOST_TEXT:] + data
        line, end, rest = self._text.partition(b"\n")
        if not end:
            return None
        self._text = rest
        try:
            return _decode(line)
        except msgspec.DecodeError:
            return None

    def close(self) -> None:
        """The agent ends, and nothing of the application goes on."""
        for descriptor in (self._command, self._reply):
            if descriptor >= 0:
                os.close(descriptor)

    def _send(self, line: str) -> None:
        try:
            os.write(self._command, f"{line}\n".encode())
        except OSError:
            raise ServiceSilent(_ENDED) from None


_ENDED = "what lets the application's time go on has ended (dodo-time)"


def _opened(path: Path, access: int) -> int:
    descriptor = os.open(path, access | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOFOLLOW)
    if not stat.S_ISFIFO(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(f"{path} is not a FIFO")
    return descriptor
