"""What a recording holds, as far as a test needs it: looked for without an index, and only until it is found."""

import collections
import functools
import io
import itertools
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.address import HEADER_BYTES, FrameError, body_length
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.wire import first_message, first_number, unzigzag

MOST_BYTES = 64 << 20
"""Of a recording that is looked through."""
SMALL_BYTES = 16 << 20
"""Of a recording that is looked through even when what is needed has been found: it may be cut."""
_BUFFER = 1 << 16
_TYPE_FIELD, _DATA_FIELD, _STAMP_FIELD = 1, 2, 6
_IMAGE = 1055
_TIMES = (5, 4, 3)
"""Fields of when a message was sampled, received and sent."""
_FIRST, _OWN = 13, frozenset({*range(2900, 2910), *range(2920, 3000)})
"""Ids below are of tools, and some are DoDo's: their times are not those of a drive."""
_DAY = 86_400_000_000
_HINT = "expected an OpenDLV recording (.rec), as cluon-rec and rec-recorder write it"


@dataclass
class LookedThrough:
    """The senders of one message, up to the one that is looked for.

    ``ends_at`` is the byte behind the last whole message that was looked at; ``is_whole`` means that no
    other follows, as far as was looked.
    """

    size: int
    count: int = 0
    ends_at: int = 0
    is_whole: bool = False
    senders: set[int] = field(default_factory=set)


def look(path: Path, message: int, sender: int) -> LookedThrough:
    """Looks for a message of a sender, from the start to the first bytes that are not a message; raises OSError."""
    with io.BufferedReader(regular_file.opened(path), _BUFFER) as stream:
        found = LookedThrough(os.fstat(stream.fileno()).st_size)
        bodies = _bodies(stream, found)
        for body in bodies:
            if _type(body) == message:
                found.senders.add(first_number(body, _STAMP_FIELD))
                if sender in found.senders:
                    found.is_whole = found.size > SMALL_BYTES
                    collections.deque(() if found.is_whole else bodies, 0)
                    return found
    return found


def picture_size(path: Path) -> tuple[int, int]:
    """Width and height of the first picture, 0 and 0 without any, or of a file that cannot be read."""
    try:
        with io.BufferedReader(regular_file.opened(path), _BUFFER) as stream:
            bodies = _bodies(stream, LookedThrough(os.fstat(stream.fileno()).st_size))
            image = next((first_message(body, _DATA_FIELD) for body in bodies if _type(body) == _IMAGE), b"")
            return first_number(image, 2), first_number(image, 3)
    except OSError:
        return 0, 0


def count(path: Path, message: int, sender: int, most: int) -> int | None:
    """How many messages of a sender there are, up to so many; None if that is not known, and raises OSError."""
    with io.BufferedReader(regular_file.opened(path), _BUFFER) as stream:
        looked = LookedThrough(os.fstat(stream.fileno()).st_size)
        bodies = _bodies(stream, looked)
        found = (1 for body in bodies if _type(body) == message and first_number(body, _STAMP_FIELD) == sender)
        number = sum(itertools.islice(found, most))
    return number if number == most or looked.is_whole else None


def problems(path: Path, message: int, sender: int, name: str, is_needed: bool) -> Iterator[InputError]:
    """What is wrong with a recording, of which a message of a sender is used.

    Without ``is_needed`` there may be none, but then of no other sender either.
    """
    try:
        found = look(path, message, sender)
        if not found.size:
            yield InputError(path, "the recording is empty: there is nothing to play", hint=_HINT)
            return
        if not found.is_whole:
            if found.ends_at >= MOST_BYTES or found.size > MOST_BYTES:
                return
            yield from _read_by_index(path, message, found)
    except OSError as error:
        yield InputError(path, f"cannot be read as a recording: {error.strerror}")
        return
    if found.count and found.size <= SMALL_BYTES and (fault := _fault(path, path.stat().st_mtime_ns)):
        yield InputError(
            path, f"the recording cannot be played: {fault}", hint="'dodo rec cut' writes a part without it"
        )
    others = ", ".join(map(str, sorted(found.senders)))
    if found.count and sender not in found.senders and (others or is_needed):
        but = f", but of {others}" if others else ""
        yield InputError(
            path, f"the recording has no {name} of sender {sender}{but}", hint="'dodo rec info' shows them"
        )


@functools.lru_cache(maxsize=64)
def _fault(path: Path, _changed_ns: int) -> str:
    """What is wrong with the times of messages; the libraries for that are loaded only where something may be."""
    try:
        with io.BufferedReader(regular_file.opened(path), _BUFFER) as stream:
            if not _is_doubtful(_bodies(stream, LookedThrough(0))):
                return ""
        import numpy as np

        from dodo_dsl.opendlv import recording_times
        from dodo_dsl.opendlv.recording import Recording, RecordingError

        with Recording(path) as recording:
            rows = [row for row, id_ in enumerate(recording.index["data_type"].tolist()) if id_ not in _OWN]
            return recording_times.fault(recording, np.array(rows, np.int64))
    except (OSError, RecordingError):
        return ""  # reported where it is read


def _is_doubtful(bodies: Iterator[bytes]) -> bool:
    """Whether a message has no time, a body that was there, or a time before another of the same message and sender."""
    last: dict[tuple[int, int], tuple[int, bytes]] = {}
    low, high = 1 << 63, 0
    for body in bodies:
        id_ = _type(body)
        if id_ < _FIRST or id_ in _OWN:
            continue
        time = next((time for number in _TIMES if (time := _time(body, number))), 0)
        key = id_, first_number(body, _STAMP_FIELD)
        before, other = last.get(key, (0, b""))
        if not time or time < before or body == other:
            return True
        last[key] = time, body
        low, high = min(low, time), max(high, time)
    return high - low > _DAY


def _time(body: bytes, wanted: int) -> int:
    """A time of an envelope in us."""
    time = first_message(body, wanted)
    return first_number(time, 1) * 1_000_000 + first_number(time, 2)


def _read_by_index(path: Path, message: int, found: LookedThrough) -> Iterator[InputError]:
    """What services make of a recording with damage; the libraries for that are loaded here only."""
    from dodo_dsl.opendlv.recording import Recording, RecordingError

    try:
        with Recording(path) as recording:
            rows = recording.rows(messages=[message])
            found.senders.update(recording.index["sender_stamp"][rows].tolist())
            found.count, damage = len(recording), recording.damage
    except RecordingError:
        found.count = 0
        yield InputError(path, f"not a recording: its {found.size} bytes hold no message", hint=_HINT)
    else:
        if damage:
            what = f"the recording has damage, which is passed over: {damage.places[0]}"
            yield InputError(path, what, hint="'dodo rec cut' writes a part without it", is_slip=True)


def _bodies(stream: BinaryIO, found: LookedThrough) -> Iterator[bytes]:
    """The encoded envelopes from the start to the first that is not whole."""
    while found.ends_at < MOST_BYTES:
        header = stream.read(HEADER_BYTES)
        if not header:
            found.is_whole = True
            return
        try:
            length = body_length(header)
        except FrameError:
            return
        body = stream.read(length)
        if len(body) < length:
            return
        found.count += 1
        found.ends_at += HEADER_BYTES + length
        yield body


def _type(body: bytes) -> int:
    """The id."""
    return unzigzag(first_number(body, _TYPE_FIELD))
