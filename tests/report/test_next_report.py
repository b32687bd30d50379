"""A report takes the place of the one before when it is whole, and not sooner."""

from pathlib import Path

import pytest

from dodo_dsl.outcome import NEXT_REPORT
from dodo_dsl.report import results
from dodo_dsl.report.next_report import next_report
from dodo_dsl.report.report_folder import write_summaries
from tests.report.joined.reports import named


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A report of the tests a and b, with a log each, and a file of the user."""
    report = tmp_path / "report"
    report.mkdir()
    write_summaries(report, [named("a"), named("b")])
    for slug in "ab":
        log(report, slug, "old")
    (report / "a" / "mine.txt").write_text("mine")
    return report


def log(report: Path, slug: str, text: str) -> None:
    (report / slug / "logs").mkdir(parents=True)
    (report / slug / "logs" / "app.log").write_text(text)


def slugs(place: Path) -> list[str]:
    return [outcome.slug for outcome in results.load(place / results.FILE_NAME)]


def hidden(place: Path) -> list[Path]:
    return list(place.glob(f"{NEXT_REPORT}*"))


def test_the_report_before_stays_until_the_next_is_whole(place: Path) -> None:
    with next_report(place, ["a"]) as report:
        log(report.folder, "a", "new")
        assert (place / "a/logs/app.log").read_text() == "old"
        report.take_place(["a"])
    assert (place / "a/logs/app.log").read_text() == "new"
    assert (place / "a/mine.txt").read_text() == "mine"
    assert not (place / "b").exists()
    assert not hidden(place)


def test_an_error_leaves_the_report_before(place: Path) -> None:
    with pytest.raises(KeyboardInterrupt), next_report(place, ["a"]) as report:
        log(report.folder, "a", "new")
        raise KeyboardInterrupt
    assert (slugs(place), (place / "a/logs/app.log").read_text()) == (["a", "b"], "old")
    assert not hidden(place)


def test_what_a_killed_run_left_is_removed_and_what_another_run_writes_is_not(place: Path) -> None:
    (place / f"{NEXT_REPORT}killed" / "a").mkdir(parents=True)
    with next_report(place, ["a"]) as other:
        assert hidden(place) == [other.folder]
        with next_report(place, ["a"]):
            assert len(hidden(place)) == 2
        assert hidden(place) == [other.folder]


def test_other_tests_of_the_report_before_may_stay(place: Path) -> None:
    with next_report(place) as report:
        log(report.folder, "a", "new")
        report.take_place(["a"], {"b"})
    assert [(place / slug / "logs/app.log").read_text() for slug in "ab"] == ["new", "old"]


def test_a_report_in_place_goes_at_once(place: Path) -> None:
    with next_report(place, ["a"], in_place=True) as report:
        assert (report.folder, (place / "a/logs").exists()) == (place, False)
        log(place, "a", "new")
        report.take_place(["a"])
    assert (place / "a/logs/app.log").read_text() == "new"
