"""The pictures of the documentation show today's pages: `scripts/make-pictures` draws them again."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.report.documented import pages, palette
from tests.report.documented.likeness import MOST_UNLIKE, Picture, unlike
from tests.report.viewer.chromium import Chromium

DRAW = "stale: scripts/make-pictures draws it again"


def read(name: str) -> Picture:
    return np.asarray(cv2.imread(str(pages.DOCS / name)), np.uint8)


FEW = [name for name, shot in pages.SHOTS.items() if shot.page.startswith("kiwi/")]
"""The pages of two drives; the others take eight."""


@pytest.mark.slow
@pytest.mark.xdist_group("chromium")
@pytest.mark.parametrize("names", [FEW, pytest.param([*pages.SHOTS], marks=pytest.mark.proof)], ids=["few", "all"])
def test_they_show_todays_pages(names: list[str], chromium: Chromium, tmp_path: Path) -> None:
    pages.drive_kiwi(tmp_path)
    if names != FEW:
        pages.drive_team(tmp_path)
    phases = [set(re.findall("<title>(.*?):", text)) for text in (trace(), pages.trace(tmp_path))]
    assert phases[0] == phases[1], f"docs/{pages.TRACE} is {DRAW}"
    for name in names:
        shot = pages.SHOTS[name]
        shown = pages.show(chromium, tmp_path, shot)
        kept = palette.text_of((pages.DOCS / name).read_bytes())
        assert kept.splitlines() == shown.words.splitlines(), f"docs/{name} is {DRAW}"
        assert unlike(read(name), shown.picture, shown.volatile) <= MOST_UNLIKE, f"docs/{name} is {DRAW}"


def trace() -> str:
    return (pages.DOCS / pages.TRACE).read_text()


@pytest.mark.thorough
def test_the_sheet_shows_todays_camera() -> None:
    assert unlike(read(pages.SHEET), pages.sheet()) <= MOST_UNLIKE, f"docs/{pages.SHEET} is {DRAW}"


@pytest.mark.thorough
def test_other_drives_are_unlike() -> None:
    """As pages that changed are: the comparison can fail."""
    drives = [read(name) for name in ("tutorial/hit-wall.png", "drive-viewer.png", "drive-viewer-perception.png")]
    assert min(unlike(one, other) for one in drives for other in drives if one is not other) > MOST_UNLIKE


def test_files_are_small_and_hold_their_words() -> None:
    names = [*pages.SHOTS, pages.SHEET]
    assert [name for name in names if (pages.DOCS / name).stat().st_size > 100_000] == []
    picture = np.zeros((4, 5, 3), np.uint8)
    picture[1, 2] = (10, 200, 30)
    data = palette.png(picture, "größer ✗")
    assert palette.text_of(data) == "größer ✗"
    assert np.array_equal(np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)), picture)
