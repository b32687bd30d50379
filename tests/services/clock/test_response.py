"""How long answers took, and what is made of it."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.clock.resting import ResponseTimes, processor_name

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


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("processor\t: 0\nmodel name\t: Some CPU @ 2 GHz\ncpu MHz\t\t: 1999.6\n", "Some CPU @ 2 GHz, 2000 MHz"),
        ("processor\t: 0\nBogoMIPS\t: 108.00\n\nHardware\t: BCM2835\nModel\t\t: Raspberry Pi 5\n", "Raspberry Pi 5"),
        ("", ""),
    ],
)
def test_the_processor_is_named_as_linux_does(text: str, name: str, tmp_path: Path) -> None:
    (tmp_path / "cpuinfo").write_text(text)
    assert processor_name(tmp_path / "cpuinfo") == name


def test_a_machine_without_proc_has_no_name(tmp_path: Path) -> None:
    assert processor_name(tmp_path / "missing") == ""
