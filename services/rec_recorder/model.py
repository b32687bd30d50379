"""A recording that is written: frames in order; of pictures, the newest ones.

What a test may send has limits: a flood ends the recording, and the error says which messages it is made of.
"""

import logging
import os
from collections import deque
from collections.abc import Callable
from pathlib import Path

from dodo_dsl.opendlv.address import FrameError
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.recording_writer import RecordingWriter
from services.base.runner import tell

MOST_PER_SECOND, MOST_OF_A_KIND = 20_000, 10_000
"""Messages within a second; of one message and sender stamp."""
_MOST_KINDS = 1000
_SECOND = 1_000_000


class FloodError(RuntimeError):
    """More is sent than a recording takes; one sentence."""


Kind = tuple[int, int]
"""A message's id and sender stamp; the id is 0 for those that are too many to be counted separately."""


class Traffic:
    """Counts envelopes by kind, and ends the recording of a flood.

    ``now`` gives microseconds of real time; it is None in lockstep, where the clock limits messages by frames. ``lost``
    gives how many messages the kernel has dropped so far, and ``name`` the message of an id.
    """

    def __init__(
        self, most_bytes: int, now: Callable[[], int] | None, lost: Callable[[], int], name: Callable[[int], str]
    ) -> None:
        self._most_bytes, self._now, self._lost, self._name = most_bytes, now, lost, name
        self._bytes: dict[Kind, int] = {}
        self._second: dict[Kind, int] = {}
        self._begin, self._lost_before = 0, 0
        self._size = self._number = 0

    def add(self, envelope: Envelope, size: int) -> None:
        """Takes an envelope of ``size`` bytes before it is written; raises FloodError, and reports it to the runner."""
        kind = (envelope.data_type, envelope.sender_stamp)
        if kind not in self._bytes and len(self._bytes) >= _MOST_KINDS:
            kind = (0, 0)
        self._bytes[kind] = self._bytes.get(kind, 0) + size
        self._size += size
        if self._size > self._most_bytes:
            what = f"the recording would be larger than {self._most_bytes / 1e6:g} MB"
            self._end(what, self._bytes, too_fast=False)
        if self._now is not None:
            self._count(kind, self._now())

    def _count(self, kind: Kind, now: int) -> None:
        if not 0 <= now - self._begin < _SECOND:
            self._second.clear()
            self._number = 0
            self._begin, self._lost_before = now, self._lost()
        self._number += 1
        count = self._second[kind] = self._second.get(kind, 0) + 1
        if count > MOST_OF_A_KIND:
            what = f"more than {MOST_OF_A_KIND} messages of a kind came within a second"
            self._end(what, self._second, too_fast=True)
        if self._number + self._lost() - self._lost_before > MOST_PER_SECOND:
            self._end(f"more than {MOST_PER_SECOND} messages came within a second", self._second, too_fast=True)

    def _end(self, what: str, counts: dict[Kind, int], *, too_fast: bool) -> None:
        (id_, stamp), most = max(counts.items(), key=lambda item: item[1])
        message = self._name(id_) if id_ else "many kinds of messages"
        share = round(most / sum(counts.values()), 3)
        tell("flood", what=what, message=message, sender_stamp=stamp, share=share, too_fast=too_fast)
        raise FloodError(f"{what}, most of it {message}/{stamp}")


_log = logging.getLogger(__name__)


class RecordingFileError(ValueError):
    """A file that cannot become a recording, or a disk that is full."""


def _new(path: Path) -> RecordingWriter:
    try:
        return RecordingWriter(path)
    except FileExistsError:
        raise RecordingFileError(f"{path} exists and is not overwritten") from None
    except OSError as error:
        raise RecordingFileError(f"{path} cannot be written: {error.strerror}") from None


class RecordingFile:
    """A new `.rec` file, of which ``traffic`` counts what it takes.

    Nothing is buffered in the process: whatever ends it, the file holds all frames written so far.
    Raises RecordingFileError for a file that exists, and if none can be made.
    """

    def __init__(self, path: Path, traffic: Traffic | None = None) -> None:
        self._traffic = traffic
        self._is_flooded = False
        self._writer = _new(path)

    def write(self, envelope: Envelope) -> None:
        """Append an envelope as it was received.

        Raises RecordingFileError when the disk takes no more, and FloodError at the limits of ``traffic``, upon which
        recording ends.
        """
        if self._is_flooded:
            return
        try:
            frame = encode_frame(envelope)
        except FrameError as error:  # larger than a frame can be
            _log.warning("a message was not recorded: %s", error)
            return
        if self._traffic is not None:
            self._is_flooded = True
            self._traffic.add(envelope, len(frame))
            self._is_flooded = False
        try:
            self._writer.write_frames((frame,))
        except OSError as error:
            place = f"{self._writer.path} ends after {self._writer.frames} messages"
            raise RecordingFileError(f"{place}: {error.strerror}") from None

    def close(self) -> None:
        self._writer.close()


_PIECE = 1 << 20


class NewestPictures:
    """A new `.rec` file of at most ``max_size`` bytes, without its oldest quarter each time that it would be larger.

    What cannot be written is logged, and ends it: pictures decide no test. Raises RecordingFileError if no file can
    be made, and for one that exists.
    """

    def __init__(self, path: Path, max_size: int) -> None:
        self._path, self._max_size = path, max_size
        self.is_on = True
        self._sizes: deque[int] = deque()
        self._writer = _new(path)

    def write(self, envelope: Envelope) -> None:
        if not self.is_on:
            return
        try:
            self._append(encode_frame(envelope))
        except (FrameError, OSError) as error:
            self.is_on = False
            _log.warning("no more pictures are recorded: %s", error)

    @property
    def is_wanted(self) -> bool:
        """Whether the file is still there: the runner removes it as soon as the test has passed."""
        return self.is_on and self._path.exists()

    def close(self) -> None:
        self._writer.close()

    def _append(self, frame: bytes) -> None:
        if len(frame) > self._max_size:
            raise FrameError(f"a picture has {len(frame)} bytes")
        if self._writer.size + len(frame) > self._max_size:
            self._shorten(len(frame))
        self._writer.write_frames((frame,))
        self._sizes.append(len(frame))

    def _shorten(self, needed: int) -> None:
        """Make room for ``needed`` bytes and more; the file is whole at any time."""
        gone = 0
        while self._sizes and self._writer.size - gone + needed > self._max_size * 3 // 4:
            gone += self._sizes.popleft()
        part = self._path.with_name(f".{self._path.name}.part")
        with os.fdopen(os.open(self._path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC), "rb") as old:
            part.unlink(missing_ok=True)
            shorter = RecordingWriter(part)
            old.seek(gone)
            shorter.write_frames(iter(lambda: old.read(_PIECE), b""))
        self._writer.close()
        part.replace(self._path)
        self._writer = shorter
