"""Suggestions for names that are not known, and hints at characters."""

import pytest

from dodo_dsl.diagnostics import closest, did_you_mean

SERVICES = ("camera", "clock", "dynamic-model", "integrator", "virtual-camera")


@pytest.mark.parametrize(
    ("word", "meant"),
    [("camera-virtual", "virtual-camera"), ("model_dynamic", "dynamic-model"), ("Dynamic-Model", "dynamic-model")],
)
def test_the_same_parts_in_another_order_are_the_one_suggestion(word: str, meant: str) -> None:
    assert closest(word, SERVICES) == [meant]
    assert did_you_mean(word, SERVICES) == f"did you mean '{meant}'?"


def test_a_misspelt_word_suggests_the_nearest() -> None:
    assert closest("integrater", SERVICES) == ["integrator"]


def test_another_word_suggests_nothing() -> None:
    assert closest("lidar", SERVICES) == []
