"""A drive as a picture in a page: all that is drawn is there, and nothing else gets in."""

import re
from pathlib import Path

import pytest

from dodo_dsl.report import trajectory_svg
from dodo_dsl.report.trajectory import DrivenPath, Ground
from tests.report.joined.reports import named

TRACK = Ground(
    models=[((1.0, 1.0, 0.0), [(0.0, 0.0)])],
    lines=[("left", [(-1.0, 0.0, -1.0, 8.0)]), ("finish", [(-1.0, 8.0, 1.0, 8.0)])],
)
DRIVE = DrivenPath([(0.0, 0.1 * n, 1.57, 0.1 * n) for n in range(70)], TRACK, goal="finish")


def kinds(drive: DrivenPath, outcome: str = "failed") -> list[str]:
    return re.findall(r'<path class="(\w+)"', trajectory_svg.draw(drive, named("a", outcome=outcome)))


def test_it_shows_walls_goal_path_and_end_and_cones_where_there_are_no_lines() -> None:
    assert kinds(DRIVE) == ["wall", "goal", "failed", "end"]
    assert kinds(DrivenPath(DRIVE.path, Ground(TRACK.models)), "passed") == ["cone", "passed", "end"]


def test_a_tall_drive_lies_with_its_begin_on_the_left() -> None:
    drawn = trajectory_svg.draw(DRIVE, named("a", outcome="failed"))
    assert 'viewBox="0 0 240 72"' in drawn
    begin = re.search(r'class="failed" d="M(\d+) (\d+)l(\d+) (-?\d+) ', drawn)
    assert begin and [int(number) for number in begin.groups()] == [8, 36, 6, 0]


def test_what_was_drawn_is_read_as_it_was_without_what_the_page_has(tmp_path: Path) -> None:
    trajectory_svg.write(DRIVE, named("a", outcome="error"), tmp_path / "a.svg")
    read = trajectory_svg.read(tmp_path / "a.svg")
    assert read.startswith('<svg viewBox="0 0 240 72"><path class="wall"') and read.endswith("</svg>")
    assert trajectory_svg.read(tmp_path / "none.svg") == ""


@pytest.mark.parametrize(
    ("old", "new"),
    [("</svg>", "<script>1</script></svg>"), ("<svg", "<svg onload='1'"), ('d="M', 'd="&quot;M'), ("wall", "x y"),
     ("</svg>\n", "</svg>\n<b>"), ("l", "l" + "1 " * 9000)],
)  # fmt: skip
def test_a_strangers_file_is_left_out(tmp_path: Path, old: str, new: str) -> None:
    text = trajectory_svg.draw(DRIVE, named("a", outcome="failed"))
    assert old in text
    (tmp_path / "a.svg").write_text(text.replace(old, new, 1))
    assert trajectory_svg.read(tmp_path / "a.svg") == ""
