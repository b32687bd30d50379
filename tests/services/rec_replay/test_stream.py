from pathlib import Path

import numpy as np
import pytest

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import Recording
from services.rec_replay.selection import select
from services.rec_replay.stream import EntryStream
from tests.services.rec_replay.recordings import IMAGE, S, images, message, picture, write


@pytest.fixture
def path(tmp_path: Path) -> Path:
    times = [n / 10 for n in range(10)]
    pedals = [message("opendlv.proxy.PedalPositionRequest", time + 0.05, position=time) for time in times]
    return write(tmp_path / "drive.rec", [*images(times), *pedals])


def stream(recording: Recording) -> EntryStream:
    return EntryStream(recording, select(recording, MessageSet.standard(), S))


def shown(one: EntryStream) -> list[int | None]:
    """The number of the next entry's picture, and so on to the end; None where an entry has none."""
    numbers: list[int | None] = []
    while True:
        try:
            _, _, _, played = one.take()
        except StopIteration:
            return numbers
        found = [n for n in range(10) if played and np.array_equal(np.asarray(played[1]), picture(n))]
        numbers.append(found[0] if found else None)


def test_all_pictures_between_messages(path: Path) -> None:
    with Recording(path) as recording:
        one = stream(recording)
        one.prepare()
        one.prepare()
        assert shown(one) == [number for n in range(10) for number in (n, None)]
        one.rewind()
        assert shown(one) == [number for n in range(10) for number in (n, None)]


def test_pictures_that_cannot_be_decoded_are_counted(tmp_path: Path) -> None:
    good = images([n / 10 for n in range(6)])
    broken = [good[1], message(IMAGE, 0.15, format="h264", data=b"nothing"), good[4], good[5]]
    strange = message(IMAGE, 0.6, format="jpegxl", width=64, height=48, data=b"x")
    with Recording(write(tmp_path / "bad.rec", [*broken, strange])) as recording:
        one = stream(recording)
        assert shown(one) == [None, None, 4, 5, None]
        assert one.decoder.early == 2
