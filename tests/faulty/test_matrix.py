"""An interrupted matrix goes on where it was."""

from collections.abc import Iterable
from pathlib import Path

import pytest

from tests.faulty import matrix
from tests.faulty.matrix import Cell, Kept, ShippedTest, run, shipped_tests

TESTS = [ShippedTest("one", "open-loop", "1"), ShippedTest("two", "perception", "2")]


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The faults that ran; every test fails, and of the fault ``broken`` none runs."""
    faults: list[str] = []

    def outcomes_of(fault: str, slugs: Iterable[str], _report: Path) -> dict[str, tuple[str, str]]:
        faults.append(fault)
        if fault == "broken":
            raise RuntimeError("dodo run ended with exit code 2")
        return dict.fromkeys(slugs, ("failed", fault))

    monkeypatch.setattr(matrix, "outcomes_of", outcomes_of)
    return faults


def test_what_is_finished_is_kept_and_not_run_again(tmp_path: Path, asked: list[str]) -> None:
    path, said = tmp_path / "deep" / "kept.json", list[str]()
    with pytest.raises(RuntimeError, match="exit code 2"):
        run(Kept(path), {"good": TESTS, "broken": TESTS}, 1, said.append)
    assert Kept(path).cells == {"good": {t.slug: Cell("failed", "good", t.digest) for t in TESTS}}
    run(Kept(path), {"good": TESTS, "other": TESTS[:1]}, 1, said.append)
    changed = ShippedTest("two", "perception", "3")
    assert Kept(path).missing("good", [TESTS[0], changed]) == [changed], "with another spec it runs again"
    assert asked == ["good", "broken", "other"]
    assert said[-1] == "[1 of 1] other: 1 of 1 tests failed"


@pytest.mark.thorough
def test_the_shipped_tests_are_those_without_hardware() -> None:
    tests = {test.slug: test for test in shipped_tests()}
    assert tests["sil-open-straight"].kind == "open-loop"
    assert tests["sil-perception--light-1--clutter-0"].digest == tests["sil-perception--light-1--clutter-60"].digest
    assert not any(slug.startswith("hil-") for slug in tests)
