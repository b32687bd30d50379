"""The pages of a joined report in a real browser."""

from pathlib import Path

import pytest

from dodo_dsl.report.join import join
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
