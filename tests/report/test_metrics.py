"""Metrics have the margins of checks with limits, and one of the test."""

import math
from dataclasses import replace

import pytest

from dodo_dsl.outcome import ServiceUse, with_margin
from dodo_dsl.report.for_gitlab import metrics_text
from tests.report.test_report_folder import OUTCOME

CHECKS = (
    with_margin({"name": "wall-margin", "value": 0.03, "limit": {"min": 0.05}, "unit": "m", "ok": False}),
    with_margin({"name": "distance", "value": 4.5, "limit": {}, "unit": "m", "ok": True}),
)


def samples(text: str, name: str) -> list[str]:
    return [line.partition("{")[2] for line in text.splitlines() if line.startswith(f"{name}{{")]


def test_margins_are_labelled_as_values_are() -> None:
    text = metrics_text([replace(OUTCOME, checks=CHECKS)])
    assert samples(text, "dodo_check_margin") == ['check="wall-margin",test="test",unit="m"} -0.020000000000000004']
    assert len(samples(text, "dodo_check_value")) == 2
    assert samples(text, "dodo_worst_margin") == ['test="test"} -0.28571428571428575']


def test_what_the_application_used() -> None:
    use = ServiceUse("steering", 1.2345, 0.4, 150_000_000)
    text = metrics_text([replace(OUTCOME, resources=(use,))])
    assert samples(text, "dodo_processor_seconds") == ['service="steering",test="test"} 1.234']
    assert samples(text, "dodo_peak_memory_bytes") == ['service="steering",test="test"} 150000000.0']


def test_an_error_has_no_margin() -> None:
    assert samples(metrics_text([replace(OUTCOME, outcome="error")]), "dodo_worst_margin") == []


def test_text_of_others_commands_no_terminal() -> None:
    check = {"name": "a\x1b[31m\nb", "value": 1, "limit": {}, "unit": "m\x1b", "ok": True, "margin": 1}
    use = ServiceUse("s\x1b", 1.0, 0.4, 1)
    text = metrics_text([replace(OUTCOME, slug="t\x1b", checks=(check,), resources=(use,))])
    assert "\x1b" not in text
    assert samples(text, "dodo_check_value") == ['check="a�[31m�b",test="t�",unit="m�"} 1.0']


@pytest.mark.parametrize(
    ("value", "text"),
    [(1, "1.0"), (1e6, "1000000.0"), (1e-7, "1e-07"), (1e300, "1e+300"), (-math.inf, "-inf"), (math.nan, "nan")],
)  # fmt: skip
def test_numbers_and_names_are_those_of_openmetrics(value: float, text: str) -> None:
    check = {"name": 'a"\\b', "value": value, "limit": {}, "unit": "", "ok": True}
    found = metrics_text([replace(OUTCOME, checks=(check,))])
    assert samples(found, "dodo_check_value") == [rf'check="a\"\\b",test="test",unit=""}} {text}']
    assert found.endswith("\n# EOF\n")
