from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from services.continuous_signal.target import Signal, Target, TargetError, check, in_order, read_recording, read_table

SECOND = 1_000_000
STEERING = Signal("opendlv.proxy.GroundSteeringRequest", 3, "groundSteering")
times = st.lists(st.integers(-(10**15), 10**15), min_size=2, max_size=30, unique=True).map(sorted)


def interpolated(knots: list[int], values: list[float], time: int) -> float | None:
    """Brute force: the straight line between the two rows around a time."""
    for at, end in enumerate(knots):
        if time == end:
            return values[at]
        if at and knots[at - 1] < time < end:
            share = (time - knots[at - 1]) / (end - knots[at - 1])
            return values[at - 1] + share * (values[at] - values[at - 1])
    return None


@given(times, st.data())
@pytest.mark.thorough
def test_between_its_samples_it_is_a_straight_line_and_beyond_them_nothing(
    knots: list[int], data: st.DataObject
) -> None:
    values = data.draw(st.lists(st.floats(-1e3, 1e3), min_size=len(knots), max_size=len(knots)))
    asked = data.draw(st.lists(st.integers(knots[0] - 9, knots[-1] + 9) | st.sampled_from(knots), max_size=30))
    found = Target(np.array(knots), np.array(values)).at(np.array(asked, np.int64))
    expected = [interpolated(knots, values, time) for time in asked]
    assert [None if np.isnan(value) else pytest.approx(value, abs=1e-6) for value in found] == expected


def test_samples_in_any_order_and_the_last_of_equal_times() -> None:
    target = in_order(np.array([3, 1, 3, 2]), np.array([30.0, 10.0, 33.0, 20.0]))
    assert (target.times.tolist(), target.values.tolist()) == ([1, 2, 3], [10.0, 20.0, 33.0])


def test_no_samples_are_a_target_that_says_nothing() -> None:
    target = in_order(np.array([], np.int64), np.array([]))
    assert np.isnan(target.at(np.array([0, 1]))).all()


def write(folder: Path, text: str) -> Path:
    path = folder / "target.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("time,groundSteering\n0,0.5\n1.25,-1e-1\n", [0.5, -0.1]),
        ("time,value\n0,0.5\n1.25,-0.1\n\n", [0.5, -0.1]),
        ("value, time ,groundSteering\n9,0,1\n9,1.25,2\n", [1, 2]),
        ("\ufefftime,value\r\n0,1\r\n1.25,2\r\n", [1, 2]),
    ],
)
def test_tables(tmp_path: Path, text: str, values: list[float]) -> None:
    target = read_table(write(tmp_path, text), "groundSteering", False)
    assert (target.times.tolist(), target.values.tolist(), target.start) == ([0, 1_250_000], values, 0)


def test_a_table_of_sample_times_is_exact_and_begins_with_its_first_row(tmp_path: Path) -> None:
    path = write(tmp_path, "time,value\n1700000000.000001,1\n1700000000.100002,2\n")
    target = read_table(path, "x", True)
    assert (target.start, target.times.tolist()) == (1_700_000_000_000_001, [0, 100_001])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", ":1: expected a header with the columns time and x (or value), found nothing"),
        ("time,y\n", ":1: expected a header with the columns time and x (or value), found time, y"),
        ("t,x\n", ":1: expected a header with the columns time and x (or value), found t, x"),
        ("time,x\n0,1\n", ": expected at least 2 rows below the header, found 1"),
        ("time,x\n0,1\n1\n", ":3: has 1 columns, expected 2 as in the header"),
        ("time,x\n0,1\n1,nan\n", ":3: the value 'nan' is not a finite number"),
        ("time,x\n0,1\n1,1e999\n", ":3: the value '1e999' is not a finite number"),
        ("time,x\n0,1\n-inf,1\n", ":3: the time '-inf' is not a finite number"),
        ("time,x\n0,1\none,1\n", ":3: the time 'one' is not a number"),
        ("time,x\n0,\n1,1\n", ":2: the value '' is not a number"),
        ("time,x\n0,1\n1,1\n1.0,2\n", ":4: the time 1.0 s appears twice, expected times that increase by at least a"),
        ("time,x\n0,1\n1,1\n0.5,2\n", ":4: the time 0.5 s comes after 1 s, expected times that increase by at least a"),
        ("time,x\n0,1\n1e30,1\n", ":3: the time 1E+30 s is out of range"),
    ],
)
def test_tables_that_are_refused(tmp_path: Path, text: str, said: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(TargetError) as raised:
        read_table(path, "x", False)
    assert str(raised.value).startswith(f"{path}{said}")


def test_files_that_are_no_tables(tmp_path: Path) -> None:
    (tmp_path / "target.csv").write_bytes(b"time,x\n\xff\xfe,1\n")
    for path in (tmp_path / "target.csv", tmp_path / "absent.csv", tmp_path):
        with pytest.raises(TargetError, match=r"cannot be read as a CSV table: "):
            read_table(path, "x", False)


@given(
    st.text()
    | st.lists(st.sampled_from(["time", "x", ",", "\n", "0", "1", ".5", "-", "nan", '"']), max_size=40).map("".join)
)
def test_any_text_is_a_target_or_one_sentence(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_text(text, encoding="utf-8", errors="replace")
    try:
        target = read_table(path, "x", False)
    except TargetError as error:
        assert str(error).startswith(str(path))
    else:
        assert (np.diff(target.times) > 0).all() and np.isfinite(target.values).all()


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
    with pytest.raises(TargetError) as raised:
        read_recording(path, STEERING, MessageSet.standard())
    assert str(raised.value).startswith(f"{path}: {said}")


def test_a_recorded_message_that_cannot_be_decoded_is_named(tmp_path: Path) -> None:
    path = recording(tmp_path, broken=encode_frame(Envelope(1090, b"\xff", 1, 0, 1, 3)))
    with pytest.raises(
        TargetError, match=r"target.rec: opendlv.proxy.GroundSteeringRequest/3 number 1: the payload is not a valid"
    ):
        read_recording(path, STEERING, MessageSet.standard())
    with pytest.raises(TargetError, match=r"cannot be read as a recording: No such file"):
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
