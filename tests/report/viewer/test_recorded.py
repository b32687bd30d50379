"""A recording as columns over the test's time."""

from pathlib import Path

import numpy as np
import pytest

from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.report.viewer import recorded
from tests.report.viewer.drives import EPOCH, MESSAGES, WALL, MadeDrive, record

STEERING = "opendlv.proxy.GroundSteeringRequest"


def test_times_are_the_tests(tmp_path: Path) -> None:
    samples = [(time, STEERING, 3, {"groundSteering": time}) for time in (0.1, 0.2, 1.5)]
    record(tmp_path / "test.rec", MadeDrive("x", 2.0, samples, {}))
    test = recorded.read(tmp_path / "test.rec", MESSAGES)
    channel = test.channel(STEERING, 3)
    assert test.duration == 2.0
    assert channel is not None
    assert channel.times.tolist() == [0.1, 0.2, 1.5]
    assert channel.numbers("groundSteering").tolist() == np.float32([0.1, 0.2, 1.5]).tolist()
    assert np.isnan(channel.numbers("speed")).all()
    assert np.interp(WALL + 1.5e6 / 20, test.walls, test.moments) == 1.5


def test_damage_strangers_and_times_of_other_clocks_are_left_out(tmp_path: Path) -> None:
    steering = MESSAGES.id(STEERING)
    good = MESSAGES.encode(MESSAGES.type(STEERING)(groundSteering=1))
    frames = [
        Envelope(MESSAGES.id("dodo.TestBegin"), b"", WALL, 0, EPOCH, 0),
        Envelope(steering, b"\x0a\xff\xff\xff", WALL, WALL, EPOCH + 1, 0),
        Envelope(steering, good, WALL, WALL, EPOCH + 2_000_000, 0),
        Envelope(steering, good, WALL, WALL, EPOCH + 1_000_000, 0),
        Envelope(steering, good, WALL, WALL, WALL, 0),
        Envelope(99_999, b"", WALL, WALL, EPOCH, 0),
    ]
    (tmp_path / "test.rec").write_bytes(b"garbage" + b"".join(map(encode_frame, frames)))
    test = recorded.read(tmp_path / "test.rec", MESSAGES)
    assert [(c.message, c.times.tolist()) for c in test.channels] == [
        (STEERING, [1.0, 2.0]),
        ("dodo.TestBegin", [0.0]),
    ]


@pytest.mark.thorough
def test_long_channels_are_thinned(tmp_path: Path) -> None:
    payload = MESSAGES.encode(MESSAGES.type(STEERING)(groundSteering=1))
    count = 2 * recorded.MOST_SAMPLES + 1
    frames = (encode_frame(Envelope(MESSAGES.id(STEERING), payload, WALL, WALL, EPOCH + n, 0)) for n in range(count))
    (tmp_path / "test.rec").write_bytes(b"".join(frames))
    (thin,) = recorded.read(tmp_path / "test.rec", MESSAGES).channels
    assert (len(thin.times), thin.every) == (13_334, 3)


def test_an_empty_recording_has_no_channels(tmp_path: Path) -> None:
    (tmp_path / "test.rec").touch()
    test = recorded.read(tmp_path / "test.rec", MESSAGES)
    assert (test.channels, test.duration) == ((), 0.0)
