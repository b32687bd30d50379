"""Which messages a command works on."""

from collections.abc import Callable
from pathlib import Path

import pytest

from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.rec.recording_filter import Excerpt, NothingSelected
from tests.rec.conftest import BEGIN, MESSAGES, message

DISTANCE, STEERING = "opendlv.proxy.DistanceReading", "opendlv.proxy.GroundSteeringRequest"


@pytest.fixture
def drive(record: Callable[..., Path]) -> Path:
    """Distances of senders 0 and 1 and a steering request, each a second after the other."""
    kinds = [(DISTANCE, 0), (DISTANCE, 1), (STEERING, 0)]
    return record(message(name, BEGIN + n * 1_000_000, stamp) for n, (name, stamp) in enumerate(kinds))


def rows(path: Path, selection: Excerpt) -> list[int]:
    with Recording(path) as recording:
        return [int(row) for row in selection.rows(recording, MESSAGES)]


@pytest.mark.parametrize(
    ("selection", "found"),
    [
        (Excerpt(), [0, 1, 2]),
        (Excerpt([DISTANCE]), [0, 1]),
        (Excerpt([f"{DISTANCE}/1"]), [1]),
        (Excerpt([str(MESSAGES.id(STEERING)), f"{DISTANCE}/0"]), [0, 2]),
        (Excerpt(start=1), [1, 2]),
        (Excerpt(end=1), [0]),
        (Excerpt(start=0.5, end=1.5), [1]),
        (Excerpt(start=BEGIN / 1e6 + 2), [2]),
        (Excerpt([DISTANCE], start=1), [1]),
    ],
)
def test_rows(drive: Path, selection: Excerpt, found: list[int]) -> None:
    assert rows(drive, selection) == found


@pytest.mark.parametrize(
    ("selection", "problem"),
    [
        (Excerpt(start=3), "no message of .* matches --start 3$"),
        (Excerpt([STEERING], end=1.5), f"matches --message {STEERING} --end 1.5$"),
        (Excerpt([f"{STEERING}/x"]), "is not a message: expected a sender stamp"),
        (Excerpt(["Steering"]), "there is no message 'Steering'"),
    ],
)
def test_nothing_is_selected(drive: Path, selection: Excerpt, problem: str) -> None:
    with pytest.raises(NothingSelected, match=problem):
        rows(drive, selection)
