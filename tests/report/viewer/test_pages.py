"""The pages of failed tests in a real browser."""

import math
import re
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import shapely

from dodo_dsl.opendlv.assets.track import VehicleBox, VehiclePose, load_obstacles, outline
from tests.report.viewer import drives, failures
from tests.report.viewer.chromium import Chromium, Page
from tests.report.viewer.hostile import HOSTILE

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("chromium")]

DRIVES = {
    "wall hit": (failures.wall_hit(), 3.21),
    "timeout": (failures.timed_out(), 40.0),
    "wrong signal": (failures.wrong_signal(), 2.4),
    "missed cones": (failures.missed_cones(), 0.7),
    "crash": (failures.crash(), 2.3),
    "set-up": (failures.set_up_failed(), 0.0),
    "false detections": (failures.false_detections(), 1.2),
    "rig refusal": (failures.rig_refused(), 0.0),
}
NAMES = list(DRIVES)
FEW = ("wall hit", "wrong signal", "false detections", "rig refusal")
"""One of each evaluator, and one without a drive."""
SCRIPTS = (drives.ROOT / "templates" / "viewer" / "drive.html").read_text().count("<script")
"""But for that of another report's way."""


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


@pytest.mark.parametrize(
    "page", [n if n in FEW else pytest.param(n, marks=pytest.mark.proof) for n in NAMES], indirect=True
)
def test_a_failed_test_opens_where_it_was_decided(page: Page, request: pytest.FixtureRequest) -> None:
    drive, moment = DRIVES[request.node.callspec.params["page"]]
    assert page.value("dodo.cursor.time()") == pytest.approx(moment)
    assert page.value("document.getElementById('reason').title") == drive.outcome["reason"]
    drawn = ["#scene svg", ".plots canvas", "#transport input"] if drive.samples else []
    assert visible(page, "#scene") == visible(page, "#signals") == bool(drive.samples), "else only the log says more"
    line = [".lines .now"] if drive.logs else []
    for part in ("#reason", "#checks h2", *drawn, *line):
        assert visible(page, part), part
    assert page.value("document.documentElement.scrollHeight <= innerHeight")


def visible(page: Page, selector: str) -> bool:
    """Whether all of an element is on the screen."""
    box = f"document.querySelector({selector!r}).getBoundingClientRect()"
    return bool(page.value(f"(b => b.width > 0 && b.height > 0 && b.top >= 0 && b.bottom <= innerHeight)({box})"))


def middle(page: Page, selector: str) -> float:
    """The brightness on the screen in the middle of an element, 0 to 255."""
    box = f"document.querySelector({selector!r}).getBoundingClientRect()"
    x, y = page.value(f"(b => [b.x + b.width / 2, b.y + b.height / 2])({box})")
    return float(page.pixels()[int(y), int(x)].mean())


_NEAR, _PATIENCE_S = 6, 10.0


def soon(page: Page, selector: str, brightness: float) -> float:
    """The same when it has become as bright as that, or in the end: a busy machine draws later than it seeks."""
    end = time.monotonic() + _PATIENCE_S
    while abs((found := middle(page, selector)) - brightness) > _NEAR and time.monotonic() < end:
        page.wait("true")
    return found


@pytest.mark.parametrize("page", ["wall hit"], indirect=True)
def test_keys_clicks_and_addresses_move_the_cursor(page: Page) -> None:
    times = []
    for key in ("Home", "ArrowRight", "ArrowRight", "ArrowLeft", "End"):
        page.press(key)
        times.append(page.value("dodo.cursor.time()"))
    assert times == pytest.approx([0, 0.1, 0.2, 0.1, page.value("dodo.cursor.last")])
    x, y, width = page.value("(b => [b.x, b.y, b.width])(document.querySelector('.u-over').getBoundingClientRect())")
    page.click(x + width / 2, y + 30)
    assert page.value("dodo.cursor.time()") == pytest.approx(3.21 / 2, abs=0.01)
    page.wait("location.hash === '#t=1.60' || location.hash === '#t=1.61'")
    page.value("location.hash = '#t=0.70'")
    page.wait("Math.abs(dodo.cursor.time() - 0.7) < 1e-6")
    page.press(" ")
    page.wait("dodo.cursor.time() > 0.8")


@pytest.mark.parametrize("page", ["timeout"], indirect=True)
def test_a_limit_has_the_same_words_beside_a_check_and_a_plot(page: Page) -> None:
    shown = page.value("document.body.innerText")
    assert shown.count("more than 0 m") == 2 and "at least 0 m" not in shown
    assert "0.17 m, expected more than 0 m" in shown


@pytest.mark.parametrize("page", ["missed cones"], indirect=True)
def test_a_frame_is_shown_with_its_boxes(page: Page) -> None:
    boxes = "Array.from(document.querySelectorAll('.screen rect'), e => e.getAttribute('class'))"
    assert page.value(boxes) == ["hit", "missed", "false"]
    assert page.value("Array.from(document.querySelectorAll('.screen text'), e => e.textContent)")[0] == "0.82"
    for at in (0.7, 1.25, 0.35):
        page.value(f"dodo.cursor.move({at})")
        shown = math.floor(at * 10 + 0.01)
        video = "document.querySelector('video')"
        page.wait(f"Math.round({video}.currentTime * 10) === {shown} && !{video}.seeking")
        assert soon(page, ".screen", 10 * shown) == pytest.approx(10 * shown, abs=_NEAR), at
    page.value("dodo.cursor.move(1.5)")
    page.wait("document.querySelector('.view').innerText.includes('it was not recorded')")
    shown = page.value("document.body.innerText")
    assert "true positives" in shown and "false positives" in shown


@pytest.mark.parametrize("page", ["wall hit"], indirect=True)
def test_all_signals_have_one_time_axis(page: Page) -> None:
    """The wheel zooms about the pointer, shift and a drag pan, a double click shows all, values are the pointer's."""
    x, y, width = page.value("(b => [b.x, b.y, b.width])(document.querySelector('.u-over').getBoundingClientRect())")
    mouse = {"x": x + width / 2, "y": y + 20}
    page.call("Input.dispatchMouseEvent", type="mouseMoved", **mouse)
    page.wait("document.querySelector('#signals h2 output').textContent === 'pointer at 1.60 s'")
    values = "Array.from(document.querySelectorAll('figcaption output'), e => e.textContent)"
    assert all(text.rpartition(" ")[2] in ("m", "m/s", "rad") for text in page.value(values)[:3])
    page.call("Input.dispatchMouseEvent", type="mouseWheel", deltaX=0, deltaY=-400, **mouse)
    page.wait("dodo.plots.range()[1] - dodo.plots.range()[0] < 2")
    first, last = page.value("dodo.plots.range()")
    assert (first + last) / 2 == pytest.approx(3.21 / 2, abs=0.02)
    for kind, moved in (("mousePressed", 0), ("mouseMoved", 50), ("mouseReleased", 50)):
        at = {"x": mouse["x"] - moved, "y": mouse["y"]}
        page.call("Input.dispatchMouseEvent", type=kind, modifiers=8, button="left", clickCount=1, **at)
    panned = page.value("dodo.plots.range()")
    assert panned[0] > first and panned[1] - panned[0] == pytest.approx(last - first)
    page.value("document.querySelector('.u-over').dispatchEvent(new MouseEvent('dblclick'))")
    page.wait("dodo.plots.range()[0] === 0 && dodo.plots.range()[1] > 3.2")


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
    """The distances to the walls are those that were judged: none after the wall was hit, which alone is marked."""
    walls = load_obstacles(drives.ROOT / "tests_registry" / "maps" / "straight")
    signal = "dodo.plots.judged().find(s => s.title === 'Distance to the walls')"
    margins = page.value(f"(s => Array.from(s.values, (v, n) => [s.times[n], v, s.mark(n)]))({signal})")
    for at, margin, mark in margins:
        area = outline(VehiclePose(*failures.into_the_wall(at)), VehicleBox(0.36, 0.16))
        assert margin <= min(shapely.distance(walls[name], area) for name in ("left", "right")) + 1e-6
        assert mark == ("failed" if margin == 0 else "")
    assert [margin for _, margin, _ in margins].count(0) == 1 and margins[-1][1] == 0


@pytest.mark.parametrize("page", ["wrong signal"], indirect=True)
def test_samples_outside_are_marked(page: Page) -> None:
    signal = "dodo.plots.judged()[0]"
    marks = page.value(f"(s => Array.from(s.times, (t, n) => [t.toFixed(1), s.mark(n)]).filter(m => m[1]))({signal})")
    assert marks == [["2.4", "failed"]]


@pytest.fixture(scope="module")
def hostile_report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report in which every string of others is hostile, each as a reason of a test, and all of them elsewhere."""
    folder = tmp_path_factory.mktemp("hostile") / "report"
    texts = [text.encode(errors="replace").decode() for text in HOSTILE]
    drive = failures.missed_cones()
    labels = [sample for n, text in enumerate(texts) for sample in failures.boxes(0.7, 0, [(text[:500], n / 30, 0.1)])]
    checks = tuple(drives.check(text[:500], 1.0, False, text[:500], max=0.5) for text in texts)
    logs = {"application.<img src=x onerror=window.hacked=1>": [(0.1, t.replace("\0", " ")) for t in texts]}
    outcomes = [
        {
            **drive.outcome,
            "reason": text,
            "name": text[:500],
            "checks": checks,
            "notes": tuple(texts),
            "last_lines": tuple(texts),
        }
        for text in HOSTILE[:3]
    ]
    drives.write(folder, [replace(drive, samples=[*drive.samples, *labels], outcome=o, logs=logs) for o in outcomes])
    return folder


def test_strings_of_others_are_text(chromium: Chromium, hostile_report: Path) -> None:
    for number, reason in enumerate(HOSTILE[:3]):
        with chromium.page((hostile_report / f"test-{number}" / "drive.html").as_uri()) as page:
            page.value("dodo.cursor.move(0.7)")
            page.wait("true")
            assert page.value("document.getElementById('reason').title") == reason
            tags = "img, svg:not(.map, .bar, .screen *), iframe, style, base"
            assert page.value(f"Array.from(document.querySelectorAll('{tags}'), e => e.outerHTML)") == []
            assert page.value("document.querySelectorAll('script').length") == SCRIPTS
            assert page.value("[window.hacked, {}.polluted, Object.keys(Object.prototype).length]") == [None, None, 0]
            shown = page.value("document.body.innerText")
            assert [text for text in HOSTILE[:18] if text not in shown] == []
            assert not re.search("[\x00-\x08\x0b-\x1f\u202a-\u202e\u2066-\u2069\u2028\u2029]", shown)
            assert len(shown) < 200_000
            assert page.faults == []
            assert [url for url in page.requests if not url.startswith((hostile_report.as_uri(), "data:,"))] == []


@pytest.mark.parametrize("page", ["crash"], indirect=True)
def test_other_signals_can_be_added(page: Page) -> None:
    titles = "Array.from(document.querySelectorAll('.plots figcaption b'), e => e.textContent)"
    before = page.value(titles)
    select = "document.querySelector('#signals select')"
    page.value(f"{select}.value = Array.from({select}.options).find(option => option.text === 'qw').value")
    page.value(f"{select}.dispatchEvent(new Event('change'))")
    assert page.value(titles) == [*before, "qw of Frame"]


@pytest.mark.parametrize("page", ["wall hit", "wrong signal", "missed cones"], indirect=True)
def test_a_phone_shows_everything_below_one_another(page: Page) -> None:
    page.resize(390, 844)
    page.wait("document.documentElement.scrollWidth <= innerWidth")
    tops = page.value("Array.from(document.querySelectorAll('main > section'), e => e.getBoundingClientRect().top)")
    assert tops == sorted(tops)


def test_lines_of_services_that_are_ready_are_hidden(chromium: Chromium, tmp_path: Path) -> None:
    crash = failures.crash()
    said = [(-0.5, "ready"), (0.1, "looking")]
    spec = "sil-perception/sil-perception.dodo.yml"
    outcome = {**crash.outcome, "name": "a[of='x $HOME'][run=2]", "seed": 7, "spec": spec}
    drives.write(tmp_path / "report", [replace(crash, outcome=outcome, logs={**crash.logs, "evaluation.track": said})])
    with chromium.page((tmp_path / "report" / "test-0" / "drive.html").as_uri()) as page:
        links = page.value("Array.from(document.querySelectorAll('#files > *'), each => each.textContent)")
        assert links == ["test.rec", "logs", "spec", "MCAP command"]
        lines = "Array.from(document.querySelectorAll('.lines p'), e => [e.innerText, e.checkVisibility()])"
        shown = f"{lines}.filter(([text]) => /ready|looking/.test(text)).map(([, isShown]) => isShown)"
        assert page.value(shown) == [False, True]
        page.value(
            "(s => { s.value = '1'; s.dispatchEvent(new Event('change')) })(document.querySelector('#log select'))"
        )
        assert page.value(shown) == [True, True]
        assert page.faults == []
