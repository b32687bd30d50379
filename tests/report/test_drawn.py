"""What is drawn of tests while others run is not drawn again."""

from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.report.next_report import Drawings
from dodo_dsl.report.report_folder import Drawable, write_report
from dodo_dsl.report.viewer import page
from tests.report.test_report_folder import OUTCOME, frame, recording
from tests.run.helpers import Bench


def test_each_test_is_drawn_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    report, pages, write = tmp_path / "report", [], page.write
    monkeypatch.setattr(page, "write", lambda folder, *rest: (pages.append(folder.name), write(folder, *rest)))
    outcomes = [replace(OUTCOME, name=slug, slug=slug) for slug in ("first", "second", "last")]
    for outcome in outcomes:
        recording(report / outcome.slug / "test.rec", frame(0), frame(1))
    test = Drawable(Bench(tmp_path).plan(), tmp_path)
    with Drawings(report) as drawings:
        for outcome in outcomes[:2]:
            drawings.begin(outcome, test)
    assert pages == ["first", "second"] and (report / "second" / "trajectory.png").is_file()
    tests = dict.fromkeys(("first", "second", "last"), test)
    assert write_report(report, outcomes, tests, drawn=drawings.problems()) == []
    assert pages == ["first", "second", "last"]
    index = (report / "index.html").read_text()
    assert all(f'href="{slug}/drive.html"' in index for slug in tests)
    assert index.count('<path class="failed" d="M') == len(tests)
    assert (report / "_viewer" / "failed.js").read_text().count('"failed"') == len(tests)


def test_what_cannot_be_drawn_is_said(tmp_path: Path) -> None:
    test = Drawable(Bench(tmp_path).plan(), tmp_path)
    (tmp_path / "report").write_text("no folder")
    with Drawings(tmp_path / "report") as drawings:
        drawings.begin(OUTCOME, test)
    (problem,) = drawings.problems()["test"]
    assert problem.startswith("the page of test cannot be written: ")


def test_pages_without_what_they_share_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: Path) -> None:
        raise OSError("no room")

    monkeypatch.setattr(page, "write_shared", refuse)
    test = Drawable(Bench(tmp_path).plan(), tmp_path)
    with Drawings(tmp_path) as drawings:
        drawings.begin(OUTCOME, test)
    problems = write_report(tmp_path, [OUTCOME], {"test": test}, drawn=drawings.problems())
    assert problems == ["the pages of the tests cannot be written: no room"]
    assert "drive.html" not in (tmp_path / "index.html").read_text()


def test_on_a_full_disk_results_have_the_room_of_pages(small_disk: Path, tmp_path: Path) -> None:
    test = Drawable(Bench(tmp_path).plan(), tmp_path)
    with Drawings(small_disk) as drawings:
        drawings.begin(OUTCOME, test)
    data = small_disk / OUTCOME.slug / "drive.js"
    data.write_bytes(data.read_bytes() + bytes(32_000))
    with (small_disk / "full").open("wb", buffering=0) as file, pytest.raises(OSError, match="No space left"):
        while True:
            file.write(bytes(4096))
    problems = write_report(small_disk, [OUTCOME], {OUTCOME.slug: test}, drawn=drawings.problems())
    assert "the pages of the tests are left out: No space left on device" in problems
    assert OUTCOME.name in (small_disk / "results.json").read_text()
    assert not data.exists()


def test_half_a_page_is_none(small_disk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: Path) -> None:
        raise OSError("no room")

    monkeypatch.setattr(page, "write_html", refuse)
    with Drawings(small_disk) as drawings:
        drawings.begin(OUTCOME, Drawable(Bench(tmp_path).plan(), tmp_path))
    assert drawings.problems()[OUTCOME.slug] == [f"the page of {OUTCOME.name} cannot be written: no room"]
    assert not (small_disk / OUTCOME.slug / "drive.js").exists()
