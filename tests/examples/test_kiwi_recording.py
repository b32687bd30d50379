"""The example's perception in a real room, as a Kiwi car's camera recorded it."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dodo_dsl import package_data
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import read_envelopes
from dodo_dsl.opendlv.video import VideoDecoder

SEEN = {
    20: [("yellow", 0.391, 0.87)],
    260: [("yellow", 0.537, 0.70)],
    340: [("blue", 0.418, 0.765), ("blue", 0.231, 0.67)],
    420: [("yellow", 0.300, 0.81), ("yellow", 0.425, 0.715), ("blue", 0.842, 0.945)],
    500: [("blue", 0.264, 0.78), ("blue", 0.605, 0.945)],
}
"""Cones that a person sees in these frames: colour, and a place inside, as fractions of the picture."""
EVERY = 10  # frames that are looked at; all are decoded, as each rests on those before


@pytest.fixture
def perception(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.syspath_prepend(str(package_data.root() / "examples" / "kiwi"))
    import perception  # type: ignore[import-not-found]

    yield perception
    del sys.modules["perception"]


@pytest.mark.slow
def test_it_finds_what_a_person_sees(perception: Any, shared_data: Callable[[str], Path]) -> None:
    path, messages, decoder = shared_data("track-1-2025-05-08.rec"), MessageSet.standard(), VideoDecoder("h264")
    counts = []
    for number, envelope in enumerate(read_envelopes(path)):
        reading: Any = messages.decode(envelope.data_type, envelope.payload)
        frame = decoder.decode(reading.data)
        assert frame is not None
        if number % EVERY:
            continue
        cones = perception.find(np.ascontiguousarray(frame.pixels("bgr")))
        counts.append(len(cones))
        for colour, x, y in SEEN.get(number, ()):
            assert any(c.colour == colour and 0 <= x - c.x <= c.width and 0 <= y - c.y <= c.height for c in cones), (
                number,
                colour,
                x,
                y,
                cones,
            )
    assert len(counts) == 60
    assert 0 not in counts
    assert np.mean(counts) < 12
