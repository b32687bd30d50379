"""Camera frames of recordings, where some cannot be decoded."""

from collections.abc import Callable
from pathlib import Path

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.rec.frames import IMAGE, decoded, packets
from tests.rec.conftest import BEGIN, HEIGHT, WIDTH, message, video


def test_packets_and_pictures(record: Callable[..., Path]) -> None:
    unknown = [message("opendlv.proxy.ImageReading", BEGIN, 7, data=b"x", format="AV99") for _ in range(2)]
    broken = Envelope(IMAGE, b"\x0b", 1, 2, 3, 8)
    told: list[str] = []
    with Recording(record([*video(3), *unknown, broken])) as recording:
        rows = recording.rows(messages=[IMAGE])
        assert [(p.sender_stamp, p.format) for p in packets(recording, rows)] == [
            *[(0, "h264")] * 3, *[(7, "AV99")] * 2, (8, ""),
        ]  # fmt: skip
        found = [frame for _, frame in decoded(recording, rows, told.append)]
    assert [frame and (frame.width, frame.height) for frame in found] == [(WIDTH, HEIGHT)] * 3 + [None] * 3
    assert [text.partition(" cannot")[0] for text in told] == ["frames of format 'AV99'"], "it is told once"
