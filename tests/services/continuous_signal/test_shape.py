"""The shape of signals made from a target: late, constant, scaled and moved ones."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.continuous_signal.measures import RepeatedValue, lag, likeness, longest_run
from services.continuous_signal.target import MICROSECONDS, Target

TIMES = np.arange(0, 8 * MICROSECONDS, MICROSECONDS // 10)
WAVE = Target(TIMES, np.sin(TIMES / MICROSECONDS))
FLAT = Target(TIMES, np.full(len(TIMES), 0.5))


@given(st.integers(0, 10))
def test_a_lag_of_some_samples_is_measured(frames: int) -> None:
    late = WAVE.at(TIMES - frames * MICROSECONDS // 10)[frames:]
    assert lag(WAVE, TIMES[frames:], late) == pytest.approx(frames / 10)


@pytest.mark.parametrize("signal", [-WAVE.values, WAVE.values + 3, np.zeros(len(TIMES))])
def test_what_no_lag_explains_has_none(signal: np.ndarray) -> None:
    assert lag(WAVE, TIMES, signal) == 0.0
    assert lag(FLAT, TIMES, signal) == 0.0


def test_the_first_of_the_longest_runs_counts_in_the_order_of_time() -> None:
    values = np.array([1.0, 2.0, 2.0, 2.0, 1.0, 3.0, 3.0, 3.0])
    order = np.array([7, 2, 5, 0, 3, 1, 6, 4])
    assert longest_run(TIMES[:8][order], values[order]) == RepeatedValue(3, 2.0, 0.1)
    assert longest_run(TIMES[:1], values[:1]) == RepeatedValue(1, 1.0, 0.0)


@pytest.mark.parametrize(
    ("signal", "words"),
    [
        (-WAVE.values, "about -1 times its target"),
        (np.degrees(WAVE.values), "about 57 times its target"),
        (WAVE.values + 0.03, "about 0.03 above its target"),
        (WAVE.values - 0.25, "about 0.25 below its target"),
        (WAVE.values, ""),
        (np.cos(TIMES / MICROSECONDS), ""),
    ],
)
def test_factor_and_offset_are_named_where_they_explain_the_distance(signal: np.ndarray, words: str) -> None:
    assert likeness(WAVE, TIMES, signal) == words
