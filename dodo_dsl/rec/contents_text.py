"""The contents of a recording for people."""

from datetime import UTC, datetime

from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.rec.contents import Contents, MessageStream

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
        lines.append(f"skipped {recording.damage.size} bytes at {recording.damage.count} places in all")
    return "\n".join([*lines, "", *_table([_HEAD, *map(_row, found.streams)])]) + "\n"


def _row(stream: MessageStream) -> tuple[str, ...]:
    rate = "" if stream.rate is None else f"{stream.rate:.2f} Hz"
    gap = "" if stream.largest_gap is None else f"{stream.largest_gap:.3f} s"
    return str(stream.id), stream.name or "(unknown)", str(stream.sender_stamp), str(stream.count), rate, gap


def _table(rows: list[tuple[str, ...]]) -> list[str]:
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEAD))]
    return ["  ".join(_cell(row, column, width) for column, width in enumerate(widths)).rstrip() for row in rows]


def _cell(row: tuple[str, ...], column: int, width: int) -> str:
    return row[column].ljust(width) if _HEAD[column] == "message" else row[column].rjust(width)
