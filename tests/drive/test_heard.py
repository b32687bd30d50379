"""An application hears nothing but what a car's bus carries, in all shipped tests."""

from pathlib import Path

import pytest

from tests.drive import heard

SHORT = ["dil-static-rig", "sil-open-straight"]
"""One that plays a recording, one with a beacon."""


@pytest.mark.slow
def test_a_listener_in_lockstep(tmp_path: Path) -> None:
    assert heard.heard(tmp_path, "lockstep", SHORT) == {name: [] for name in SHORT}


@pytest.mark.proof
@pytest.mark.realtime
@pytest.mark.parametrize("clock", heard.TESTS_IN)
def test_a_listener_in_all_shipped_tests(tmp_path: Path, clock: str) -> None:
    assert heard.heard(tmp_path, clock, heard.TESTS_IN[clock]) == {name: [] for name in heard.TESTS_IN[clock]}
