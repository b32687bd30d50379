"""An application hears what a car's bus carries, in all shipped tests, and the documentation says what that is."""

from pathlib import Path

import pytest

from tests.drive import heard

SHORT = ["dil-static-rig", "sil-open-straight"]
"""One that plays a recording, one with a beacon."""


def test_the_page_has_what_was_heard() -> None:
    assert heard.PAGE.read_text() == heard.page(), "run scripts/make-heard --page"
    assert {clock: sorted(found) for clock, found in heard.read().items()} == heard.TESTS_IN, "run scripts/make-heard"
    assert [heard.strangers(found) for found in heard.read().values()] == [{}, {}]


def compare(folder: Path, clock: str, tests: list[str]) -> None:
    """DoDo's own exchange may be heard or not, by when the listener joins."""
    found, known = heard.heard(folder, clock, tests), heard.read()[clock]
    assert sorted(found) == tests
    assert heard.strangers(found) == {}
    assert {name: set(names) for name, names in found.items()} == {name: set(known[name]) for name in tests}


@pytest.mark.slow
def test_a_listener_in_lockstep(tmp_path: Path) -> None:
    compare(tmp_path, "lockstep", SHORT)


@pytest.mark.proof
@pytest.mark.realtime
@pytest.mark.parametrize("clock", heard.TESTS_IN)
def test_a_listener_in_all_shipped_tests(tmp_path: Path, clock: str) -> None:
    compare(tmp_path, clock, heard.TESTS_IN[clock])
