"""What the page says, and what it finds wrong with a matrix."""

from pathlib import Path

import pytest

from tests.faulty import page
from tests.faulty.makes import GOOD
from tests.faulty.matrix import ROOT, Cell, ShippedTest
from tests.faulty.table import FAULTS

OPEN, PERCEPTION = "sil-open-straight", "sil-perception--light-1--clutter-0"
TESTS = [ShippedTest(OPEN, "open-loop", "1"), ShippedTest(PERCEPTION, "perception", "2")]
NAN = {
    OPEN: Cell("failed", "steering was not a finite number in 55 samples", "1"),
    PERCEPTION: Cell("passed", "found all", "2"),
}
EXPECTED = "steering-nan: expected 'not a finite number' of sil-open-straight, which"
ALL_WELL = {test.slug: Cell("passed", "well", test.digest) for test in TESTS}


def test_a_caught_fault_is_no_problem() -> None:
    assert page.problems({GOOD: ALL_WELL, "steering-nan": NAN}, TESTS) == []


@pytest.mark.parametrize(
    ("fault", "cells", "problem"),
    [
        (GOOD, {OPEN: Cell("failed", "no", "1")}, "the example does not pass sil-open-straight: no"),
        ("steering-nan", ALL_WELL, f"{EXPECTED} passed: well"),
        ("steering-nan", {OPEN: Cell("failed", "too slow", "1")}, f"{EXPECTED} failed: too slow"),
        ("steering-nan", {PERCEPTION: Cell("error", "no", "2")}, f"steering-nan: {PERCEPTION} ended in error: no"),
        ("silent", {PERCEPTION: Cell("passed", "", "2")}, "silent: tests of kind perception pass, and gaps.yml does"),
    ],
)
def test_a_problem_is_a_sentence(fault: str, cells: dict[str, Cell], problem: str) -> None:
    assert any(line.startswith(problem) for line in page.problems({fault: cells}, TESTS))


def test_the_page_has_marks_reasons_and_gaps(tmp_path: Path) -> None:
    page.write(tmp_path / "page.md", {GOOD: ALL_WELL, "steering-nan": NAN}, TESTS)
    text = (tmp_path / "page.md").read_text()
    assert f"1 of {len(FAULTS)} are caught by one test or more. The example itself passes all tests." in text
    assert "| `steering-nan` | Sends NaN | **F** | · |" in text
    assert "| `steering-nan` | `sil-open-straight` | steering was not a finite number in 55 samples |" in text
    assert "| perception | `steering-nan` | perception tests do not look at steering |" in text
    written = (ROOT / "docs" / "reference" / "kill-matrix.md").read_text(encoding="utf-8")
    assert page.of_ranges() in written and page.of_ros() in written
