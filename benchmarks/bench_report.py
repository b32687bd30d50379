"""How large the pages of a report are, and how soon Chromium shows them: python benchmarks/bench_report.py.

The suite page has 20, 100 and 1,000 tests, of which all failed, each tenth in the same way, as failed ones take the
most room; each has eight checks. The drive's page is of 60 s with a frame of 640x480 each
100 ms. "Shown" is from the start of the navigation to the first image on the screen after everything is loaded.
"""

import json
import math
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

import numpy as np

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, attempt, cost_row, plan, report
from dodo_dsl.opendlv.video import VideoEncoder
from dodo_dsl.outcome import Outcome
from dodo_dsl.report.report_folder import write_summaries
from tests.report.viewer import drives, failures
from tests.report.viewer.chromium import PROGRAM, Chromium

SIZES, ROUNDS = (20, 100, 1000), 5
LARGEST = {100: 1.0}
"""MB that the page of so many tests may have."""
SLOWEST = {1000: 1.0}
"""Seconds until the page of so many tests is shown."""
CHECKS = tuple(drives.check(f"check-{n}", 0.5 + n / 20, False, "m", max=0.4) for n in range(8))
DRIVE_S, FPS, WIDTH, HEIGHT = 60, 10, 640, 480
NO_BROWSER = "Chromium is not here"
_SHOWN = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(performance.now()))))"

Samples = Sequence[float]


def row(what: str, unit: str, values: Samples, limit: float | None = None) -> Row:
    return cost_row(what, unit, values, goal=None if limit is None else Goal(limit, of="value"))


def suites(folder: Path) -> Iterator[tuple[int, Path]]:
    """The pages of so many tests."""
    kinds = (
        failures.wall_hit, failures.timed_out, failures.wrong_signal, failures.crash, failures.no_answer,
        failures.missed_cones, failures.set_up_failed, failures.false_detections, failures.interrupted,
        failures.rig_refused,
    )  # fmt: skip
    made = [replace(drives.outcome_of(kind(), "test"), checks=CHECKS) for kind in kinds]
    for size in SIZES:
        place = folder / str(size)
        place.mkdir()
        outcomes: list[Outcome] = [
            replace(made[n % len(made)], name=f"{made[n % len(made)].name}-{n}", slug=f"test-{n}") for n in range(size)
        ]
        write_summaries(place, outcomes)
        yield size, place / "index.html"


def long_drive() -> drives.MadeDrive:
    """A minute along a circle with frames whose content moves."""
    encoder, rng = VideoEncoder("bgr", WIDTH, HEIGHT), np.random.default_rng(3)
    ground = rng.integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8)
    frames: list[drives.Sample] = []
    for number in range(DRIVE_S * FPS):
        data = encoder.encode(np.roll(ground, 3 * number, axis=1) // 4)
        fields = {"format": "h264", "width": WIDTH, "height": HEIGHT, "data": data}
        frames.append((number / FPS, "opendlv.proxy.ImageReading", 0, fields))
    way = drives.poses(lambda t: (math.cos(t / 4), math.sin(t / 4), t / 4 + math.pi / 2), DRIVE_S)
    lines = [(t / 10, f"frame {t}: steering 0.1 rad") for t in range(DRIVE_S * 10)]
    samples = [*frames, *way, *drives.requests(lambda t: 0.1 * math.sin(t), DRIVE_S)]
    return drives.MadeDrive(
        "sil-closed-straight", DRIVE_S, samples, {"reason": "did not reach finish"}, {"application.steering": lines}
    )


@contextmanager
def browser(folder: Path) -> Iterator[Chromium]:
    chromium = Chromium(folder / "profile")
    try:
        yield chromium
    finally:
        chromium.close()


def shown(chromium: Chromium, page: Path, rounds: Iterator[int]) -> list[float]:
    """Seconds, round by round; a browser's first page is not counted."""
    found = []
    with chromium.page("about:blank#") as tab:
        for _ in rounds:
            tab.call("Page.navigate", url=page.as_uri())
            tab.wait("location.protocol === 'file:' && document.readyState === 'complete'")
            found.append(tab.value(_SHOWN) / 1000)
            tab.call("Page.navigate", url="about:blank#")
            tab.wait("location.protocol === 'about:'")
    return found


def megabytes(*paths: Path) -> float:
    return sum(path.stat().st_size for path in paths) / 1e6


def main() -> int:
    budget = Budget.given()
    times = [f"report, {size:,} tests, shown" for size in SIZES] + ["report, a drive of 60 s with frames, shown"]
    limits = [*(SLOWEST.get(size) for size in SIZES), None]
    sizes = {
        **{size: f"report, {size:,} tests, size" for size in SIZES},
        0: "report, a drive of 60 s with frames, size",
    }
    plan(*(row(what, "MB", (), LARGEST.get(size)) for size, what in sizes.items()))
    plan(*(row(*both) for both in zip(times, ["s"] * len(times), [()] * len(times), limits, strict=True)))
    if PROGRAM is None:
        print(f"{NO_BROWSER}: only the sizes")
        plan(*(row(name, "s", ()) for name in times), note=NO_BROWSER)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        pages = list(suites(folder))
        for size, page in pages:
            report(row(sizes[size], "MB", [megabytes(page)], LARGEST.get(size)))
            print(f"{size:5} tests: {megabytes(page):.2f} MB")
        (folder / "drive").mkdir()
        drives.write(folder / "drive" / "report", [long_drive()])
        test = folder / "drive" / "report" / "test-0"
        own = [path for path in test.iterdir() if path.suffix in (".html", ".js", ".mp4")]
        report(row(sizes[0], "MB", [megabytes(*own)]))
        print(json.dumps({path.name: round(megabytes(path), 3) for path in own}))
        if PROGRAM is None:
            return 0
        with browser(folder) as chromium:
            places = [*(page for _, page in pages), test / "drive.html"]
            for what, page, limit in zip(times, places, limits, strict=True):
                with attempt(row(what, "s", (), limit)):
                    found = shown(chromium, page, budget.rounds(ROUNDS))
                    report(row(what, "s", found, limit))
                    print(f"{what}: {min(found):.2f} to {max(found):.2f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
