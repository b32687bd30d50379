import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.opendlv.recording_writer import RecordingWriter
from services.rec_replay.selection import select

S = 1_000_000
T0 = 1_600_000_000 * S
STEERING, PEDAL, IMAGE = 1090, 1086, 1055
ENTRIES = [  # id, sender stamp, sample time in s after T0; None for zero
    (STEERING, 0, 0.5),
    (PEDAL, 0, 0.0),
    (IMAGE, 0, 1.0),
    (IMAGE, 1, 1.1),
    (2900, 0, 1.2),
    (STEERING, 2, 9.0),
    (4711, 0, None),
]


@pytest.fixture
def recording(tmp_path: Path) -> Iterator[Recording]:
    path = tmp_path / "drive.rec"
    with RecordingWriter(path) as writer:
        for id_, stamp, time in ENTRIES:
            sampled = 0 if time is None else T0 + round(time * S)
            writer.write(Envelope(id_, b"", T0 + 2 * S, 0, sampled, stamp))
    with Recording(path) as recording:
        yield recording


def chosen(recording: Recording, selection: dict[str, Any], timemod: float = 1.0) -> list[tuple[int, float, str]]:
    part = select(recording, MessageSet.standard(), S, timemod=timemod, **selection)
    how = [
        f"{'sent ' * sent}{'shown' * shown}".strip()
        for sent, shown in zip(part.sent.tolist(), part.shown.tolist(), strict=True)
    ]
    return list(zip(part.rows.tolist(), (part.due / S).tolist(), how, strict=True))


def test_all_in_the_order_of_sample_times_with_gaps_cut(recording: Recording) -> None:
    assert chosen(recording, {}) == [
        (1, 0.0, "sent"),
        (0, 0.5, "sent"),
        (2, 1.0, "shown"),
        (6, 2.0, "sent"),  # a message without a sample time counts from when it was sent
        (5, 3.0, "sent"),
    ]


@pytest.mark.parametrize(
    ("selection", "rows"),
    [
        ({"messages": ["opendlv.proxy.GroundSteeringRequest"]}, [0, 2, 5]),
        ({"messages": ["opendlv.proxy.GroundSteeringRequest/2", "4711"], "camera": None}, [6, 5]),
        ({"without": ["opendlv.proxy.GroundSteeringRequest/0", "1086"]}, [2, 6, 5]),
        ({"camera": 1}, [1, 0, 3, 6, 5]),
        ({"start": 0.4, "end": 1.05}, [0, 2]),
        ({"start": 1.5}, [6, 5]),
    ],
)
def test_parts(recording: Recording, selection: dict[str, Any], rows: list[int]) -> None:
    assert [row for row, _, _ in chosen(recording, selection)] == rows


def test_filters_do_not_change_the_times(recording: Recording) -> None:
    some = chosen(recording, {"messages": ["4711", "opendlv.proxy.GroundSteeringRequest/2"], "camera": None})
    assert [due for _, due, _ in some] == [2.0, 3.0]


@pytest.mark.parametrize(
    ("selection", "problem"),
    [
        ({"start": 60}, "has no message in the selected part"),
        ({"messages": ["1090/x"]}, "'1090/x' is not a message: expected a sender stamp, a number"),
        (
            {"without": ["opendlv.GroundSteeringRequest"]},
            r"'opendlv.proxy.GroundSteeringRequest'\?",
        ),
    ],
)
def test_wrong_parts(recording: Recording, selection: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        chosen(recording, selection)


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (
            {0: T0 + 400 * 86_400 * S},
            "message 1 (opendlv.proxy.GroundSteeringRequest/0, at byte 0) has a time days from",
        ),
        ({2: 1, 3: 2}, "message 3 (opendlv.proxy.ImageReading/0, at byte"),
    ],
)
def test_a_recording_whose_times_cannot_be_right_is_not_played(
    recording: Recording, damage: dict[int, int], said: str
) -> None:
    for row, time in damage.items():
        recording.index["time"][row] = time
    with pytest.raises(ValueError, match=re.escape(f"cannot be played: {said}")):
        chosen(recording, {})
