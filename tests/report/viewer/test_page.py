"""Writing a page loads no plotting library, and no video library where there are no pictures."""

import subprocess
import sys
from pathlib import Path

import pytest

from dodo_dsl.plan.plan_json import to_json
from dodo_dsl.report.files import SHARED
from dodo_dsl.report.viewer import page
from tests.report.viewer import drives, failures
from tests.report.viewer.drives import ROOT

SCRIPT = """
import sys
from pathlib import Path
from dodo_dsl.plan.plan_json import from_json
from dodo_dsl.report import results
from dodo_dsl.report.viewer import page
report, plan = map(Path, sys.argv[1:])
outcome, = results.load(report / "results.json")
page.write_shared(report, [outcome])
page.write(report / outcome.slug, outcome, from_json(plan.read_text()), report.parent / "compiled")
print(sorted({"av", "PIL", "shapely"} & set(sys.modules)))
"""


@pytest.mark.thorough
def test_a_page_is_cheap_to_write(tmp_path: Path) -> None:
    drive = failures.wall_hit()
    drives.write(tmp_path / "report", [drive])
    before = (tmp_path / "report" / "test-0" / "drive.js").read_bytes()
    (tmp_path / "test.json").write_text(to_json(drives.shipped(drive.slug)))
    words = [sys.executable, "-c", SCRIPT, tmp_path / "report", tmp_path / "test.json"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
    assert (tmp_path / "report" / "test-0" / "drive.js").read_bytes() == before


def test_shared_files_are_written_through_no_symlink(tmp_path: Path) -> None:
    (tmp_path / "others").mkdir()
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / SHARED).symlink_to(tmp_path / "others")
    page.write_shared(tmp_path / "report", [])
    assert list((tmp_path / "others").iterdir()) == []
    assert (tmp_path / "report" / SHARED / "main.js").is_file()
