"""The pages of failed tests in a real browser."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import shapely

from services.collision.geometry import VehicleBox, VehiclePose, outline
from services.collision.obstacles import load
from tests.report.viewer import drives, failures
from tests.report.viewer.chromium import Chromium, Page

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("chromium")]

DRIVES = {
    "wall hit": (failures.wall_hit(), 3.21),
    "timeout": (failures.timed_out(), 40.0),
    "wrong signal": (failures.wrong_signal(), 2.4),
    "crash": (failures.crash(), 2.3),
    "no answer": (failures.no_answer(), 1.7),
}
NAMES = list(DRIVES)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pages") / "report"
    drives.write(folder, (drive for drive, _ in DRIVES.values()))
    return folder


def address(report: Path, name: str) -> str:
    return (report / f"test-{NAMES.index(name)}" / "drive.html").as_uri()


@pytest.fixture
def page(chromium: Chromium, report: Path, request: pytest.FixtureRequest) -> Iterator[Page]:
    with chromium.page(address(report, request.param)) as opened:
        yield opened
        assert opened.faults == []
        assert [url for url in opened.requests if not url.startswith((report.as_uri(), "data:,"))] == []


@pytest.mark.parametrize("page", NAMES, indirect=True)
def test_a_failed_test_opens_where_it_was_decided(page: Page, request: pytest.FixtureRequest) -> None:
    drive, moment = DRIVES[request.node.callspec.params["page"]]
    assert page.value("dodo.cursor.time()") == pytest.approx(moment)
    assert page.value("document.getElementById('reason').textContent") == drive.outcome["reason"]
    for part in ("#reason", "#scene canvas", ".plots canvas", "#transport input", *[".lines .now"] * bool(drive.logs)):
        assert visible(page, part), part
    assert page.value("document.documentElement.scrollHeight <= innerHeight")


def visible(page: Page, selector: str) -> bool:
    """Whether all of an element is on the screen."""
    box = f"document.querySelector({selector!r}).getBoundingClientRect()"
    return bool(page.value(f"(b => b.width > 0 && b.height > 0 && b.top >= 0 && b.bottom <= innerHeight)({box})"))


@pytest.mark.parametrize("page", ["wall hit"], indirect=True)
def test_keys_clicks_and_addresses_move_the_cursor(page: Page) -> None:
    times = []
    for key in ("Home", "ArrowRight", "ArrowRight", "ArrowLeft", "d"):
        page.press(key)
        times.append(page.value("dodo.cursor.time()"))
    assert times == pytest.approx([0, 0.1, 0.2, 0.1, 3.21])
    x, y, width = page.value(
        "(b => [b.x, b.y, b.width])(document.querySelector('.plots canvas').getBoundingClientRect())"
    )
    page.click(x + 52 + (width - 62) / 2, y + 30)
    assert page.value("dodo.cursor.time()") == pytest.approx(3.21 / 2, abs=0.01)
    page.wait("location.hash === '#t=1.60' || location.hash === '#t=1.61'")
    page.value("location.hash = '#t=0.70'")
    page.wait("Math.abs(dodo.cursor.time() - 0.7) < 1e-6")
    page.press(" ")
    page.wait("dodo.cursor.time() > 0.8")


@pytest.mark.parametrize("page", ["crash"], indirect=True)
def test_the_log_follows_the_cursor(page: Page) -> None:
    now = "document.querySelector('.lines .now').innerText.split(/\\s+/).join(' ')"
    assert page.value(now) == "2.30 steering KeyError: 'blue'"
    assert page.value("Array.from(document.querySelectorAll('.lines .error span'), e => e.textContent)") == [
        "Traceback (most recent call last):",
        '  File "steering.py", line 12, in <module>',
        "KeyError: 'blue'",
    ]
    assert visible(page, ".lines .error")
    page.value("dodo.cursor.move(1.23)")
    assert page.value(now) == "1.20 steering frame 12: steering 0.000 rad"
    page.value("document.querySelector('.lines .error').click()")
    assert page.value("dodo.cursor.time()") == pytest.approx(2.3)


@pytest.mark.parametrize("page", ["wall hit"], indirect=True)
def test_the_margin_is_the_evaluators(page: Page) -> None:
    """The distances to the walls are those of the geometry by which walls are judged."""
    walls = load(drives.ROOT / "tests_registry" / "maps" / "straight")
    box = VehicleBox(0.36, 0.16)
    margins = page.value("Array.from(dodo.way.margins())")
    assert margins[-1] == 0 < min(margins[:-20])
    poses = [VehiclePose(*failures.into_the_wall(n / 100)) for n in range(len(margins))]
    lines = [walls["left"], walls["right"]]
    expected = [min(shapely.distance(line, outline(pose, box)) for line in lines) for pose in poses]
    assert margins == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("page", ["wrong signal"], indirect=True)
def test_samples_outside_are_marked(page: Page) -> None:
    signal = "dodo.signals.judged()[0]"
    marks = page.value(f"(s => Array.from(s.times, (t, n) => [t.toFixed(1), s.marked(n)]).filter(m => m[1]))({signal})")
    assert marks == [["2.4", "failed"]]
