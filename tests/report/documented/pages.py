"""The pictures of the documentation, made of today's pages: drives in lockstep, and a browser that shows them.

The drives and so the pictures are the same each time, but for wall times: in the log of a drive and beside a report's
tests. Those are in no comparison (``VOLATILE``).
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.pictures import contact_sheet, trace_picture
from tests.report.documented import palette
from tests.report.documented.likeness import Picture, Place
from tests.report.viewer.chromium import Chromium, Page

ROOT = Path(__file__).parents[3]
DOCS = ROOT / "docs"
TRACE, SHEET = "trace.svg", "virtual-camera.png"

VOLATILE = "#log, .number, .facts"
"""What shows wall times."""
_MENDED = ("-(left + right)", "-0.3 * (left + right)")
_CONES = """\
dodo: 1
name: sil-cones
extends: ../sil-perception/sil-perception.dodo.yml
matrix:
environment: {camera: {with: {exposure: 0.45, clutter: 60}}}
evaluation: {cones: {with: {min-precision: 90 %}}}
"""
_CURVE = """\
dodo: 1
name: sil-curve
extends: ../sil-closed-left-curve/sil-closed-left-curve.dodo.yml
application: {env: {STEERING_GAIN: "0.3"}}
"""


@dataclass(frozen=True)
class Shot:
    """A page of a report, and how it is shown."""

    page: str
    ready: str = "dodo.plots && Array.from(document.querySelectorAll('video'), v => v.readyState).every(s => s > 1)"
    moment: float | None = None
    """Test time in s, where it is not the one that decided."""
    size: tuple[int, int] = (1366, 768)
    is_dark: bool = False
    words: str = "header, nav, main"
    """The elements whose words are kept in the picture's file."""


SHOTS = {
    "tutorial/hit-wall.png": Shot("team/dodo-report/sil-curve/drive.html"),
    "drive-viewer.png": Shot("kiwi/dodo-report/sil-curve/drive.html"),
    "drive-viewer-perception.png": Shot("kiwi/dodo-report/sil-cones/drive.html", moment=3.9, is_dark=True),
    "report-page.png": Shot(
        "team/compared/index.html",
        ready="document.getElementById('_tests')",
        size=(1024, 1060),
        words="h1, #_changes, #_tests",
    ),
}


def drive(work: Path) -> None:
    """The reports whose pages are shown, below a folder."""
    drive_team(work)
    drive_kiwi(work)


def drive_team(work: Path) -> None:
    """Those of an application that is new."""
    team = work / "team"
    team.mkdir()
    dodo(team, "new", "--application")
    dodo(team, "new", "sil-curve", "--extends", "sil-closed-left-curve")
    deployment = team / "dodo.yml"
    deployment.write_text(deployment.read_text().replace("registry: [tests]", 'registry: [tests, "dodo:"]'))
    steering, names = team / "steering.py", ("sil-first", "sil-curve", "sil-closed-straight", "sil-open-straight")
    written = steering.read_text()
    assert _MENDED[0] in written
    steering.write_text(written.replace(*_MENDED))
    dodo(team, "run", *names, "--report", "main")
    steering.write_text(written)
    dodo(team, "run", *names)
    dodo(team, "report", "dodo-report", "-o", "compared", "--against", "main")


def drive_kiwi(work: Path) -> None:
    """Those of the example."""
    kiwi = work / "kiwi"
    for name in ("maps", "targets", "sil-perception", "sil-closed-left-curve"):
        shutil.copytree(ROOT / "tests_registry" / name, kiwi / "tests" / name)
    shutil.copytree(ROOT / "examples" / "kiwi", kiwi / "application")
    for name, spec in (("sil-cones", _CONES), ("sil-curve", _CURVE)):
        (kiwi / "tests" / name).mkdir()
        (kiwi / "tests" / name / f"{name}.dodo.yml").write_text(spec)
    (kiwi / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: application/docker-compose.yml\n")
    python(kiwi, "benchmarks.pictures.run_trace", "trace.json", "sil-cones", "sil-curve")


def dodo(folder: Path, *words: str) -> None:
    """A command whose tests may fail, in a folder, without history of earlier runs."""
    python(folder, "dodo_dsl", *words)


def python(folder: Path, *words: str) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), "XDG_STATE_HOME": str(folder.parent / "state")}
    command = [sys.executable, "-m", *words]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stdout + done.stderr


@dataclass(frozen=True)
class Shown:
    """The picture of a page, its words, and the places in it that differ each time."""

    picture: Picture
    words: str
    volatile: Sequence[Place]


def show(browser: Chromium, work: Path, shot: Shot) -> Shown:
    with browser.page((work / shot.page).as_uri(), *shot.size, dark=shot.is_dark) as page:
        page.call("Emulation.setScrollbarsHidden", hidden=True)
        page.wait(shot.ready)
        if shot.moment is not None:
            page.value(f"dodo.cursor.move({shot.moment})")
            page.wait("Array.from(document.querySelectorAll('video'), v => !v.seeking).every(Boolean)")
        parts = f"Array.from(document.querySelectorAll('{VOLATILE}'))"
        places = page.value(f"{parts}.map(e => e.getBoundingClientRect()).map(b => [b.x, b.y, b.width, b.height])")
        picture = settled(page)
        page.value(f"{parts}.forEach(e => {{ e.style.visibility = 'hidden'; }})")
        words = page.value(f"Array.from(document.querySelectorAll('{shot.words}'), e => e.innerText).join('\\n')")
    said = "\n".join(line for line in words.splitlines() if not line.startswith("Note: "))  # a busy machine's
    return Shown(picture, said, [tuple(map(round, place)) for place in places])


def settled(page: Page) -> Picture:
    """The screen when nothing moves on it any more."""
    before = page.pixels()
    for _ in range(50):
        page.wait("true")
        now = page.pixels()
        if (now == before).all():
            break
        before = now
    return before


def trace(work: Path) -> str:
    """Where the time of the run with a profile went."""
    trace = json.loads((work / "kiwi" / "trace.json").read_text())
    return trace_picture.draw({"sil-cones and sil-curve at once": trace})


def sheet() -> Picture:
    """The camera's conditions."""
    return contact_sheet.sheet()


def write(browser: Chromium, work: Path, target: Path, said: Callable[[str], object]) -> None:
    """All pictures, below a folder as below ``docs``."""
    drive(work)
    files = {name: show(browser, work, shot) for name, shot in SHOTS.items()} | {SHEET: Shown(sheet(), "", ())}
    for name, shown in files.items():
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        (target / name).write_bytes(palette.png(shown.picture, shown.words))
        said(f"{name}: {(target / name).stat().st_size:,} bytes")
    (target / TRACE).write_text(trace(work))
