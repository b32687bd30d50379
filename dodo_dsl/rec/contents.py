"""What a recording holds: messages with their rates and gaps, frames, times, and what was skipped; also as text."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from dodo_dsl.opendlv import recording_times
from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.rec.frames import decoded


@dataclass(frozen=True)
class MessageStream:
    """The messages of one id and sender; rate in Hz and largest gap in s are None for a single message."""

    id: int
    name: str | None
    sender_stamp: int
    count: int
    bytes: int
    rate: float | None
    largest_gap: float | None


@dataclass(frozen=True)
class Frames:
    """Packets with camera frames, and how many of them give a frame (None if they were not decoded)."""

    packets: int
    decoded: int | None


@dataclass(frozen=True)
class Contents:
    """Start and duration in s, from sample times if there are any; ``unordered`` counts steps back in time.

    ``apart`` messages are more than a day away from most others and do not count for these: in lockstep, what an
    application stamps with the time of its machine lies years from the time of the test.
    """

    size: int
    envelopes: int
    begin: float | None
    duration: float
    unordered: int
    apart: int
    untimed: int
    message_set: str
    messages: list[MessageStream]
    frames: Frames

    def as_json(self, recording: Recording) -> dict[str, Any]:
        """For programs; see docs/how-to/recordings.md."""
        facts = asdict(self)
        facts["skipped"] = [asdict(place) for place in recording.damage.places]
        facts["skipped_bytes"], facts["skipped_places"] = recording.damage.size, recording.damage.count
        return {"file": str(recording.path), **facts}


def look(
    recording: Recording, messages: MessageSet, message_set: str, decodes: bool, problem: Callable[[str], None]
) -> Contents:
    """Count everything; ``problem`` gets a sentence about what cannot be decoded at all."""
    found = streams(recording, messages)  # before the times are copied, for the sake of memory
    times = recording.index["time"]
    stamped = times[times != 0]
    known = stamped[recording_times.together(stamped)]
    return Contents(
        size=recording.size,
        envelopes=len(recording),
        begin=int(known.min()) / 1e6 if len(known) else None,
        duration=int(known.max() - known.min()) / 1e6 if len(known) else 0.0,
        unordered=int((np.diff(known) < 0).sum()),
        apart=len(stamped) - len(known),
        untimed=int((recording.index["sampled"] == 0).sum()),
        message_set=message_set,
        messages=found,
        frames=_frames(recording, decodes, problem),
    )


def streams(recording: Recording, messages: MessageSet) -> list[MessageStream]:
    """The messages of each id and sender."""
    index, known = recording.index, messages.ids()
    found = []
    for rows in recording_times.streams(index, np.arange(len(index))):
        id_, stamp = int(index["data_type"][rows[0]]), int(index["sender_stamp"][rows[0]])
        size = int(index["size"][rows].sum(dtype=np.int64))
        name = messages.name(id_) if id_ in known else None
        found.append(MessageStream(id_, name, stamp, len(rows), size, *_rate(index["time"][rows])))
    return found


def _rate(times: Numbers) -> tuple[float | None, float | None]:
    ordered = np.sort(times[times != 0])
    span = int(ordered[-1] - ordered[0]) if len(ordered) > 1 else 0
    if not span:
        return None, None
    return round((len(ordered) - 1) * 1e6 / span, 3), int(np.diff(ordered).max()) / 1e6


def _frames(recording: Recording, decodes: bool, problem: Callable[[str], None]) -> Frames:
    rows = recording.rows(messages=[IMAGE])
    found = sum(frame is not None for _, frame in decoded(recording, rows, problem)) if decodes else None
    return Frames(len(rows), found)


_SHOWN = 10
_HEAD = ("id", "message", "sender", "count", "rate", "largest gap")


def contents_text(found: Contents, recording: Recording) -> str:
    """Some lines of facts and a table of messages."""
    lines = [f"{recording.path}: {found.envelopes} messages in {found.duration:.1f} s, {found.size} bytes"]
    if found.begin is not None:
        lines.append(f"begins {datetime.fromtimestamp(found.begin, UTC):%Y-%m-%d %H:%M:%S} UTC")
    if found.apart:
        are = "1 message is" if found.apart == 1 else f"{found.apart} messages are"
        lines.append(f"{are} more than a day away from these and not counted")
    lines.append(f"message set {found.message_set}")
    if found.frames.packets:
        decoded = "not decoded" if found.frames.decoded is None else f"{found.frames.decoded} decoded"
        lines.append(f"camera frames: {found.frames.packets} packets, {decoded}")
    if found.unordered or found.untimed:
        lines.append(f"{found.unordered} steps back in time, {found.untimed} messages without a sample time")
    lines += [f"skipped {place}" for place in recording.damage.places[:_SHOWN]]
    if recording.damage.count > _SHOWN:
        lines.append(f"skipped {recording.damage.size} bytes at {recording.damage.count} positions in all")
    return "\n".join([*lines, "", *_table([_HEAD, *map(_row, found.messages)])]) + "\n"


def _row(stream: MessageStream) -> tuple[str, ...]:
    rate = "" if stream.rate is None else f"{stream.rate:.2f} Hz"
    gap = "" if stream.largest_gap is None else f"{stream.largest_gap:.3f} s"
    return str(stream.id), stream.name or "(unknown)", str(stream.sender_stamp), str(stream.count), rate, gap


def _table(rows: list[tuple[str, ...]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    aligned = [f"{{:{'<' if name == 'message' else '>'}{width}}}" for name, width in zip(_HEAD, widths, strict=True)]
    return ["  ".join(aligned).format(*row).rstrip() for row in rows]
