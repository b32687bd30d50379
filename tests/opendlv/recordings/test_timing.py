"""Times of recordings that cannot be right, as services, tests and the compiler tell them."""

from pathlib import Path

import numpy as np
import pytest

from dodo_dsl.opendlv import recording_times
from dodo_dsl.opendlv.assets import recording_contents
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.recording import Recording

T0, S, STEERING, TOOL = 1_600_000_000_000_000, 1_000_000, 1090, 11
DRIVE = [Envelope(STEERING, bytes([n]), t, t, t, n % 2) for n, t in enumerate(range(T0, T0 + 20 * S, S))]


def at(row: int, **changed: int) -> list[Envelope]:
    return [each._replace(**changed) if number == row else each for number, each in enumerate(DRIVE)]


@pytest.mark.parametrize(
    ("envelopes", "said"),
    [
        (DRIVE, ""),
        (at(7, sample_time=0), ""),
        ([*DRIVE, Envelope(TOOL, b"", 0, 0, 0, 0)], ""),
        ([Envelope(2900, b"", 0, 0, 0, 0), *DRIVE], ""),
        (
            at(7, sent=0, received=0, sample_time=0),
            "message 8 (opendlv.proxy.GroundSteeringRequest/1, at byte 301) has no time at all, one of 1",
        ),
        (
            at(7, sample_time=T0 - 10**15),
            "message 8 (opendlv.proxy.GroundSteeringRequest/1, at byte 301) has a time days from",
        ),
        (at(7, sample_time=T0 + 100 * S), "message 10 (opendlv.proxy.GroundSteeringRequest/1, at byte 387) goes back"),
        (
            [*DRIVE[:9], *DRIVE[8:]],
            "message 10 (opendlv.proxy.GroundSteeringRequest/0, at byte 387) is there twice, as",
        ),
        (DRIVE[10:] + DRIVE[:10], "message 11 (opendlv.proxy.GroundSteeringRequest/0, at byte 430) goes back in time"),
    ],
)
def test_what_cannot_be_right_is_told_with_its_place(tmp_path: Path, envelopes: list[Envelope], said: str) -> None:
    path = tmp_path / "drive.rec"
    path.write_bytes(b"".join(map(encode_frame, envelopes)))
    with Recording(path) as recording:
        types = recording.index["data_type"]
        found = recording_times.fault(recording, np.flatnonzero(types < 2900))
    assert found.startswith(said)
    assert bool(found) == bool(said)
    problems = list(recording_contents.problems(path, STEERING, 0, "steering", is_needed=True))
    assert [problem.what for problem in problems] == [f"the recording cannot be played: {found}"] * bool(said)


def test_times_of_tools_lie_within_those_of_the_others(tmp_path: Path) -> None:
    path = tmp_path / "drive.rec"
    tools = [Envelope(TOOL, b"", time, time, time, 0) for time in (T0 - 90 * S, T0 + 90 * S)]
    path.write_bytes(b"".join(map(encode_frame, [*tools, *DRIVE])))
    with Recording(path) as recording:
        times = recording_times.within(recording, np.arange(len(recording)))
    assert (times.min(), times.max()) == (T0, T0 + 19 * S)
