"""The pages of a joined report in a real browser."""

from pathlib import Path

import pytest

from dodo_dsl.report.comparison import compare
from dodo_dsl.report.join import join, write_other_paths
from dodo_dsl.report.report_folder import write_summaries
from dodo_dsl.report.results import read_given
from tests.report.viewer import drives, failures
from tests.report.viewer.chromium import Chromium


@pytest.mark.slow
@pytest.mark.xdist_group("chromium")
def test_each_drive_is_replayed_from_the_joined_report(chromium: Chromium, tmp_path: Path) -> None:
    folder, out = tmp_path / "report", tmp_path / "out"
    drives.write(folder, [failures.missed_cones()])
    outcomes, _ = join([read_given(folder), read_given(folder)], out)
    write_summaries(out, outcomes)
    folder.rename(tmp_path / "gone")
    with chromium.page((out / "index.html").as_uri()) as page:
        for outcome in outcomes:
            page.value(f"document.querySelector('[href=\"{outcome.slug}/drive.html\"]').click()")
            page.wait("window.dodo && dodo.cursor && document.readyState === 'complete'")
            assert page.value("document.getElementById('name').textContent") == outcome.name
            assert page.value("document.getElementById('reason').title") == outcome.reason
            page.wait("Array.from(document.querySelectorAll('video'), v => v.readyState).every(state => state > 1)")
            page.value("document.querySelector('.names a').click()")
            page.wait("document.getElementById('_tests') && document.readyState === 'complete'")
        assert page.faults == []
        assert [url for url in page.requests if not url.startswith((out.as_uri(), "data:,"))] == []
    assert outcomes[1].slug == "test-0--report-2"
    assert (out / "test-0--report-2" / "camera-0.mp4").is_file()


@pytest.mark.slow
@pytest.mark.xdist_group("chromium")
def test_the_paths_of_two_reports_are_drawn_over_one_another(chromium: Chromium, tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    drives.write(tmp_path / "old" / "report", [failures.timed_out()])
    outcomes = drives.write(tmp_path / "report", [failures.wall_hit()])
    other = read_given(tmp_path / "old" / "report")
    comparison = compare(outcomes, other)
    address = (tmp_path / "report" / "test-0" / "drive.html").as_uri()
    write_other_paths(tmp_path / "report", comparison, other)
    with chromium.page(address) as page:
        assert page.value("document.querySelectorAll('.map .earlier').length") == 2
        page.value("dodo.cursor.move(2)")
        caption = page.value("document.querySelector('#scene .caption').textContent")
        assert caption.endswith("dashed: before (failed), 0.802 m apart")
        assert page.faults == []
        both = page.pixels()
    write_other_paths(tmp_path / "report", None, None)
    with chromium.page(address) as page:
        page.value("dodo.cursor.move(2)")
        assert page.value("document.querySelectorAll('.map .earlier').length") == 0
        assert "dashed" not in page.value("document.querySelector('#scene .caption').textContent")
        assert page.faults == []
        assert (page.pixels() != both).any(axis=2).sum() > 500
