"""The pages of a report have no fault that axe-core finds: contrast, names, order of headings, focus."""

import os
from pathlib import Path
from typing import Any

import pytest

from tests.report.viewer import drives, failures
from tests.report.viewer.chromium import Chromium

CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
AXE = CACHE / "dodo" / "axe-core" / "node_modules" / "axe-core" / "axe.min.js"
FOUND = "done => done.violations.map(each => [each.id, each.nodes.map(node => node.html)])"
RUN = f"axe.run(document, {{resultTypes: ['violations']}}).then({FOUND})"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.xdist_group("chromium"),
    pytest.mark.skipif(not AXE.is_file(), reason="there is no axe-core: scripts/install-chromium"),
]


def faults(chromium: Chromium, page_file: Path, width: int, dark: bool, before: str = "0") -> Any:
    with chromium.page(page_file.as_uri(), width, 800, dark) as page:
        page.value("document.querySelectorAll('details').forEach(each => { each.open = true; })")
        page.value(f"{AXE.read_text()}; {before}; 0")
        page.wait("true")
        return page.value(RUN)


def test_axe_finds_no_fault_and_would(chromium: Chromium, tmp_path: Path) -> None:
    drives.write(tmp_path / "report", [failures.wall_hit(), failures.missed_cones(), failures.crash()])
    for name in ("index.html", "test-0/drive.html"):
        for width, dark in ((1366, False), (390, True)):
            assert faults(chromium, tmp_path / "report" / name, width, dark) == [], (name, width)
    broken = "document.querySelector('h1').style.color = '#aaa'; document.querySelector('main').prepend(new Image())"
    found = {name for name, _ in faults(chromium, tmp_path / "report" / "index.html", 1366, False, broken)}
    assert {"color-contrast", "image-alt"} <= found
