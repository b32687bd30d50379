import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.object_detection.score import Gap, Silence

times = st.lists(st.floats(-1, 11, width=32), max_size=20)


@given(times, st.floats(0, 5, width=32), st.floats(5, 10, width=32))
def test_the_longest_gap_against_numpy(answers: list[float], begin: float, end: float) -> None:
    gap = Silence(start_up=-1.0, answers=answers).gap(begin, end)
    inside = np.sort([time for time in answers if begin <= time <= end])
    assert gap.end - gap.begin == pytest.approx(np.diff(np.array([begin, *inside, end])).max())


def test_a_first_answer_within_the_start_up_begins_the_judged_time() -> None:
    assert Silence(2.0, answers=[2.0, 3.0]).gap(0.0, 4.0) == Gap(2.0, 3.0)
    assert Silence(1.9, answers=[2.0, 3.0]).gap(0.0, 4.0) == Gap(0.0, 2.0)
