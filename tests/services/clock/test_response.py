"""How long answers took, and what is made of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.clock.resting import ResponseTimes

times = st.lists(st.floats(0.0, 10.0), min_size=1, max_size=50)


@given(times)
def test_figures_are_those_of_numpy(taken: list[float]) -> None:
    response = ResponseTimes()
    for frame, seconds in enumerate([99.0, *taken], 1):
        response.add(frame, seconds)
    facts = response.facts()
    assert facts["answers"] == len(taken)
    assert facts["median_s"] == pytest.approx(np.median(taken))
    assert facts["p95_s"] == np.percentile(taken, 95, method="inverted_cdf")
    assert facts["worst_s"] == max(taken)
    assert (facts["worst_frame"], facts["over"]) == (taken.index(max(taken)) + 2, None)


def test_answers_beyond_period_and_limit_are_counted() -> None:
    response = ResponseTimes(period_s=0.1, limit_s=0.3)
    for frame, seconds in enumerate((9.0, 0.05, 0.1, 0.2, 0.3, 0.31)):
        response.add(frame, seconds)
    facts = response.facts()
    assert (facts["slow"], facts["over"]) == (3, 1)


def test_without_a_second_answer_there_is_nothing_to_report() -> None:
    response = ResponseTimes()
    response.add(1, 0.5)
    assert response.facts() == {}
