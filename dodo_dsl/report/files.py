"""The files of a test in a report, and how they are removed."""

import contextlib
import re
import shutil
from collections.abc import Collection, Sequence
from pathlib import Path

from dodo_dsl.plan.added_services import PICTURES_FILE, RECORDING, SNAPSHOT
from dodo_dsl.report import results
from dodo_dsl.spec.matrix import SLUG

PAGE, DATA = "drive.html", "drive.js"
SHARED = "_viewer"
"""The folder of scripts and style for the pages of all tests; no test's folder begins with an underscore."""
LOGS, ATTEMPTS = "logs", "attempts"
VIDEOS = tuple(f"camera-{number}.mp4" for number in range(4))
"""Of the cameras of a test."""
TRAJECTORY, FRAME = "trajectory.png", "frame.jpg"
"""The drive from above, and what the camera saw at the moment that decided."""
_MADE = (TRAJECTORY, FRAME, SNAPSHOT, RECORDING, PICTURES_FILE, "sandbox.log", *VIDEOS)
_COPIED = re.compile(
    rf"({ATTEMPTS}/[1-9][0-9]{{0,3}}/)?({LOGS}/[^/\0]+\.(log|times|judged)|{'|'.join(map(re.escape, _MADE))})"
)


def is_of_a_test(path: str) -> bool:
    """Whether a path in a test's folder is a file that a report has of it, but for its page."""
    return _COPIED.fullmatch(path) is not None


def forget(folder: Path, slugs: Sequence[str], others: Collection[str] = ()) -> None:
    """Removes the reports of an earlier run but for its tests ``others``, and those of ``slugs``; other files stay."""
    try:
        earlier = [outcome.slug for outcome in results.load(folder)]
    except results.ResultsError:
        earlier = []
    for slug in {*slugs, *earlier} - {*others}:
        if SLUG.fullmatch(slug):
            _forget_test(folder / slug)


def _forget_test(place: Path) -> None:
    if place.is_symlink():
        place.unlink()  # what it points to is not a report
        return
    for name in (LOGS, ATTEMPTS):
        with contextlib.suppress(OSError):
            (place / name).unlink() if (place / name).is_symlink() else shutil.rmtree(place / name)
    for name in (*_MADE, PAGE, DATA):
        (place / name).unlink(missing_ok=True)
    with contextlib.suppress(OSError):  # there is none, or it holds what others put there
        place.rmdir()
