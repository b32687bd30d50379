from dataclasses import replace

import numpy as np
import pytest

from services.continuous_signal.measures import LateFacts, RepeatedValue, SignalLimits, SignalMeasures, WorstSample
from services.continuous_signal.model import verdict
from services.continuous_signal.target import Target
from tests.services.continuous_signal.test_model import limits

TARGET = Target(np.array([0, 10_000_000]), np.array([0.0, 1.0]))
GOOD = SignalMeasures(
    12, 12, 0, (), mean=0.01, std=0.02, distance=0.3, share=0.9, worst=WorstSample(12.3, 0.1, 0.4), mean_over_time=0.01
)
LIMITS = limits(max_mean=0.05, band=0.1, min_share=0.8, min_samples=10)


def reason(measures: SignalMeasures, limited: SignalLimits = LIMITS) -> str:
    return verdict("speed", TARGET, measures, limited, "within 9.00 s", LateFacts()).reason


def test_over_time_is_told_only_where_it_says_more() -> None:
    both = SignalMeasures(12, 12, 0, (), mean=0.06, share=0.9, mean_over_time=0.07)
    assert reason(both) == "the mean distance is 0.06 (at most 0.05)"
    one = SignalMeasures(12, 12, 0, (), mean=0.05, share=0.9, mean_over_time=0.07)
    assert reason(one) == "the mean distance over time is 0.07 (at most 0.05)"


@pytest.mark.parametrize(
    ("measures", "text"),
    [
        (SignalMeasures(0, 0, 0, ()), "no sample of speed came within 9.00 s"),
        (SignalMeasures(1, 0, 0, (2.5,)), "speed was not a finite number in its one sample, first at 2.50 s"),
        (SignalMeasures(2, 0, 0, (2.5, 3.0)), "speed was not a finite number in 2 samples, first at 2.50 s"),
        (SignalMeasures(3, 0, 3, ()), "none of 3 samples of speed is from the target's time, 0.00 s to 10.00 s"),
    ],
)
def test_without_samples_the_reason_is_why(measures: SignalMeasures, text: str) -> None:
    failed = verdict("speed", TARGET, measures, LIMITS, "within 9.00 s", LateFacts())
    assert (failed.outcome, failed.reason, failed.silent) == ("failed", text, measures.received == 0)


def test_a_lag_and_a_value_that_stays_are_named() -> None:
    bad = replace(GOOD, lag=0.3, repeats=RepeatedValue(7, 0.05, 2.0), likeness="about 2 times its target")
    limited = limits(max_mean=0.05, max_lag=0.15, max_repeats=4)
    assert reason(bad, limited) == (
        "it lags its target by 0.3 s (at most 0.15 s); 7 samples in a row have the same value, 0.05, from 2.00 s on "
        "(at most 4); worst at 12.30 s: 0.1 with a target of 0.4"
    )


def test_a_failure_says_what_the_signal_is_of_its_target() -> None:
    bad = replace(GOOD, mean=0.06, likeness="about 2 times its target")
    assert "(at most 0.05); the signal is about 2 times its target; worst" in reason(bad)
    assert "times its target" not in reason(replace(bad, mean=0.01))
