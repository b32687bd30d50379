"""Rates in lockstep, and the message that completes a frame."""

from pathlib import Path

import pytest

from dodo_dsl.check import catalogue
from dodo_dsl.check.spec_rules import check_clock_rates
from tests.check.contexts import context, found

RATE = """\
clock: {clock}
action:
  vehicle: {{uses: dynamic-model, with: {{freq: {freq} Hz}}}}
  pose: {{uses: integrator}}
"""


@pytest.mark.parametrize("freq", ["5", "10", "2.5", "100", "10000"])
def test_multiples_and_fractions_fit(freq: str, tmp_path: Path) -> None:
    assert found(check_clock_rates, RATE.format(clock="lockstep", freq=freq), tmp_path) == []


def test_another_rate_does_not_fit(tmp_path: Path) -> None:
    message = "'vehicle' has 75 Hz, not a whole multiple or fraction of the 10 Hz of the test's frames"
    (problem,) = check_clock_rates(context(RATE.format(clock="lockstep", freq="75"), tmp_path))
    assert (problem.rule, problem.message) == ("clock-rate", message)
    assert problem.hint == "in lockstep a step takes 100 ms; use for example 80 Hz"


def test_real_time_takes_any_rate(tmp_path: Path) -> None:
    assert found(check_clock_rates, RATE.format(clock="realtime", freq="75"), tmp_path) == []


def test_a_message_must_complete_a_frame(tmp_path: Path) -> None:
    page = catalogue.pages()["clock-answers"]
    (problem,) = check_clock_rates(context(page.bad, tmp_path))
    assert (problem.rule, problem.severity) == ("clock-answers", "warning")
    assert found(check_clock_rates, page.good, tmp_path) == []
