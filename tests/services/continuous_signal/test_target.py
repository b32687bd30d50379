from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st

from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from services.continuous_signal.target import Signal, check, in_order, read_recording, read_table

SECOND = 1_000_000
STEERING = Signal("opendlv.proxy.GroundSteeringRequest", 3, "groundSteering")
times = st.lists(st.integers(-(10**15), 10**15), min_size=2, max_size=30, unique=True).map(sorted)


def test_samples_in_any_order_and_the_last_of_equal_times() -> None:
    target = in_order(np.array([3, 1, 3, 2]), np.array([30.0, 10.0, 33.0, 20.0]))
    assert (target.times.tolist(), target.values.tolist()) == ([1, 2, 3], [10.0, 20.0, 33.0])


def test_a_table_of_sample_times_is_exact_and_begins_with_its_first_row(tmp_path: Path) -> None:
    path = tmp_path / "target.csv"
    path.write_text("time,value\n1700000000.000001,1\n1700000000.100002,2\n")
    target = read_table(path, "x", True)
    assert (target.start, target.times.tolist()) == (1_700_000_000_000_001, [0, 100_001])


def recording(folder: Path, *samples: tuple[int, int, float], broken: bytes = b"") -> Path:
    """A recording that begins with another message at 100 s; samples are a time, a sender and a steering."""
    messages = MessageSet.standard()
    pedal = messages.type("opendlv.proxy.PedalPositionRequest")(position=1)
    frames = [encode_frame(Envelope(1086, messages.encode(pedal), 1, 0, 100 * SECOND, 0))]
    for time, sender, value in samples:
        payload = messages.encode(messages.type(STEERING.message)(groundSteering=value))
        frames.append(encode_frame(Envelope(1090, payload, 101 * SECOND, 0, time, sender)))
    (folder / "target.rec").write_bytes(b"".join(frames) + broken)
    return folder / "target.rec"


def test_a_recording_counts_from_its_first_message_and_is_put_in_order(tmp_path: Path) -> None:
    path = recording(tmp_path, (103 * SECOND, 3, 0.5), (102 * SECOND, 3, 0.25), (102 * SECOND, 4, 9), (0, 3, 0.125))
    target = read_recording(path, STEERING, MessageSet.standard())
    assert target.start == 100 * SECOND
    assert target.times.tolist() == [SECOND, 2 * SECOND, 3 * SECOND]
    assert target.values.tolist() == [0.125, 0.25, 0.5]


@pytest.mark.parametrize(
    ("samples", "said"),
    [
        ([], "has no opendlv.proxy.GroundSteeringRequest of sender 3"),
        (
            [(1, 7, 0.0), (2, 4, 0.0)],
            "has no opendlv.proxy.GroundSteeringRequest of sender 3, but of 4, 7",
        ),
        (
            [(1, 3, 0.0), (2, 3, float("nan"))],
            "opendlv.proxy.GroundSteeringRequest/3 number 2: groundSteering is nan, exp",
        ),
    ],
)
def test_recordings_that_are_refused(tmp_path: Path, samples: list[tuple[int, int, float]], said: str) -> None:
    path = recording(tmp_path, *samples)
    with pytest.raises(InputError) as raised:
        read_recording(path, STEERING, MessageSet.standard())
    assert str(raised.value).startswith(f"{path}: {said}")


def test_a_recorded_message_that_cannot_be_decoded_is_named(tmp_path: Path) -> None:
    path = recording(tmp_path, broken=encode_frame(Envelope(1090, b"\xff", 1, 0, 1, 3)))
    with pytest.raises(
        InputError, match=r"target.rec: opendlv.proxy.GroundSteeringRequest/3 number 1: the payload is not a valid"
    ):
        read_recording(path, STEERING, MessageSet.standard())
    with pytest.raises(InputError, match=r"cannot be read as a recording: No such file"):
        read_recording(tmp_path / "absent.rec", STEERING, MessageSet.standard())


@pytest.mark.parametrize(
    ("signal", "said"),
    [
        (Signal("opendlv.proxy.GroundSteeringRequest", 0, "groundSteer"), "did you mean 'groundSteering'?"),
        (
            Signal("opendlv.sim.KinematicState", 0, "q"),
            "has no field 'q'; it has vx, vy, vz, rollRate, pitchRate, yawRate",
        ),
        (Signal("opendlv.sim.Command", 0, "command"), "the field command of opendlv.sim.Command is not a number"),
        (
            Signal("opendlv.proxy.ImageReading", 0, "data"),
            "the field data of opendlv.proxy.ImageReading is not a number",
        ),
        (Signal("opendlv.proxy.GroundSteering", 0, "x"), "there is no message 'opendlv.proxy.GroundSteering'"),
    ],
)
def test_signals_that_are_none(signal: Signal, said: str) -> None:
    with pytest.raises((ValueError, KeyError)) as raised:
        check(signal, MessageSet.standard())
    assert said in str(raised.value)
