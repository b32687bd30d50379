import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.object_detection.score import Gap, JudgedFrame, Silence

times = st.lists(st.floats(-1, 11, width=32), max_size=20)


@given(st.lists(st.booleans(), max_size=40), st.randoms())
@pytest.mark.thorough
def test_unanswered_frames_against_numpy(answered: list[bool], random: np.random.Generator) -> None:
    frames = [JudgedFrame(i, f"at {i} s", float(i) if yes else None) for i, yes in enumerate(answered)]
    random.shuffle(frames)  # type: ignore[arg-type]
    found = Silence(start_up=-1.0, frames=frames).unanswered()
    assert (found.frames, found.silent) == (len(answered), np.count_nonzero(~np.array(answered, bool)))
    edges = np.diff(np.flatnonzero(np.diff(np.array([True, *answered, True])))[::1]) if answered else np.array([])
    assert len(found.longest) == (edges[::2].max() if len(edges) else 0)
    places = [int(frame.place.split()[1]) for frame in found.longest]
    assert places == list(range(places[0], places[0] + len(places))) if places else not found.silent


@given(times, st.floats(0, 5, width=32), st.floats(5, 10, width=32))
def test_the_longest_gap_against_numpy(answers: list[float], begin: float, end: float) -> None:
    gap = Silence(start_up=-1.0, answers=answers).gap(begin, end)
    inside = np.sort([time for time in answers if begin <= time <= end])
    assert gap.end - gap.begin == pytest.approx(np.diff(np.array([begin, *inside, end])).max())


def test_a_first_answer_within_the_start_up_begins_the_judged_time() -> None:
    assert Silence(2.0, answers=[2.0, 3.0]).gap(0.0, 4.0) == Gap(2.0, 3.0)
    assert Silence(1.9, answers=[2.0, 3.0]).gap(0.0, 4.0) == Gap(0.0, 2.0)
