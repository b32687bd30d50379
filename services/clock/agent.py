"""What lets the application's time go on (``native/agent.c``). In a container the application may write there, too."""

import os
import select
import stat
import time
from pathlib import Path
from typing import Annotated

import msgspec

from services.clock.exchange import SLICE_S, IsStopped, ServiceSilent

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
        self._text = bytearray()
        self._lines: list[bytes] = []
        self._poll = select.poll()

    def open(self, stopped: IsStopped) -> None:
        """Wait until it is there, and hide the FIFOs from all others; raises ServiceSilent."""
        deadline = time.monotonic() + PATIENCE_S
        while self._command < 0 and not stopped():
            if self._is_open():
                self._send("mine")
            elif time.monotonic() > deadline:
                raise ServiceSilent(f"nothing in {self._folder} lets the application's time go on (dodo-time)")
            else:
                time.sleep(SLICE_S)

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
        if not self._lines and self._poll.poll(timeout * 1000):
            self._read()
        try:
            return _decode(self._lines.pop(0)) if self._lines else None
        except msgspec.DecodeError:
            return None

    def close(self) -> None:
        """The agent ends, and nothing of the application goes on."""
        for descriptor in (self._command, self._reply):
            if descriptor >= 0:
                os.close(descriptor)
        self._command = self._reply = -1

    def _send(self, line: str) -> None:
        try:
            os.write(self._command, f"{line}\n".encode())
        except OSError:
            raise ServiceSilent("what lets the application's time go on has ended (dodo-time)") from None

    def _read(self) -> None:
        try:
            data = os.read(self._reply, _MOST_TEXT)
        except BlockingIOError:
            return
        if not data:
            raise ServiceSilent("what lets the application's time go on has ended (dodo-time)")
        self._text += data
        *lines, rest = bytes(self._text).split(b"\n")
        self._lines += lines
        self._text = bytearray(rest if len(rest) < _MOST_TEXT else b"")


def _opened(path: Path, access: int) -> int:
    descriptor = os.open(path, access | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOFOLLOW)
    if not stat.S_ISFIFO(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(f"{path} is not a FIFO")
    return descriptor
