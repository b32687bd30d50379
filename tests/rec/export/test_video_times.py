"""Times of frames in a video."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.rec.video import DEFAULT_LASTING, MOST_GAP, VideoTimes, timed


def test_times_rise_and_come_back_to_those_of_the_frames() -> None:
    times = VideoTimes()
    assert [times.shown(each) for each in (5, 5, 5, 6, 100)] == [0, 1, 2, 3, 95]
    assert (times.begin, times.late, times.gaps) == (5, 3, 0)


def test_a_single_frame_lasts_a_while() -> None:
    assert list(timed(iter([(1, b"x")]), np.array([3, 9]), VideoTimes())) == [(1, b"x", 0, DEFAULT_LASTING)]


@given(st.lists(st.integers(-(2**52), 2**52), max_size=20))
def test_each_frame_lasts_until_the_next(taken: list[int]) -> None:
    found = list(timed(iter([(number, b"") for number in range(len(taken))]), np.array(taken, np.int64), VideoTimes()))
    shown = [time for _, _, time, _ in found]
    assert len(found) == len(taken) and shown[:1] in ([], [0])
    assert [lasting for _, _, _, lasting in found[:-1]] == np.diff(shown).tolist()
    assert all(0 < lasting <= MOST_GAP for _, _, _, lasting in found)
