"""The intrinsics of a rig's camera, measured by pictures of the board and written into dodo.yml."""

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

import cv2
import numpy as np

from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.cli.rig_measure import asker
from dodo_dsl.run.rigs import access, rig_entry
from dodo_dsl.run.rigs.access import occupied
from dodo_dsl.run.rigs.axis_calibration import CalibrationProblem
from dodo_dsl.run.rigs.camera_calibration import (
    FEWEST_CORNERS,
    FEWEST_PICTURES,
    BoardView,
    Intrinsics,
    intrinsics,
    view,
)
from dodo_dsl.run.rigs.leases import devices_in
from dodo_dsl.run.rigs.permission import STILL, refuse_forbidden
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.manifest import load_manifests
from dodo_dsl.spec.rig import Rig
from dodo_dsl.terminal import json_text, printable

PICTURES = 12
HOW = "close to all edges and corners of the picture, tilted by 20 to 45 degrees to all sides"


def measure_camera(
    options: argparse.Namespace, deployment: Deployment, rig: Rig, stdout: TextIO, stderr: TextIO
) -> int:
    """Measures and writes; the exit code. Raises UsageError, RigProblem and LeaseTimeout."""

    def say(text: str) -> None:
        stderr.write(f"{printable(text)}\n")

    try:
        if options.pictures:
            views = _of_folder(options.pictures, say)
        else:
            views = _of_camera(options, deployment, rig, asker(stderr), say)
        found = intrinsics(views)
        file = None if options.dry_run else deployment.file
        if file:
            rig_entry.write(file, rig.name, {("camera", "intrinsics"): _entry(found)})
    except CalibrationProblem as problem:
        say(f"dodo rig measure: {problem}")
        return Exit.PROBLEMS
    stdout.write(_camera_json(rig, found, file) if options.json else _camera_text(rig, found, file))
    return Exit.OK


def _of_folder(folder: Path, say: Callable[[str], None]) -> list[BoardView]:
    if not folder.is_dir():
        raise UsageError(f"--pictures: {folder} is not a folder")
    files = sorted(file for file in folder.iterdir() if file.suffix.lower() in (".png", ".jpg", ".jpeg"))
    if not files:
        raise UsageError(f"--pictures: {folder} has no .png or .jpg")
    views = []
    for file in files:
        picture = _picture(file.read_bytes())
        seen = None if picture is None else view(picture)
        if seen is not None:
            views.append(seen)
        else:
            reason = (
                "is not a picture" if picture is None else f"shows fewer than {FEWEST_CORNERS} corners of the board"
            )
            say(f"{file}: not used, because it {reason}")
    return views


def _picture(data: bytes) -> Any:
    """The grey picture of a file's bytes; None if they are none."""
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE) if data else None


def _of_camera(
    options: argparse.Namespace,
    deployment: Deployment,
    rig: Rig,
    ask: Callable[[str], str],
    say: Callable[[str], None],
) -> list[BoardView]:
    snapshot = access.snapshot(rig, load_manifests(deployment.services)[0], None)
    devices = devices_in(snapshot.words)
    refuse_forbidden(devices, STILL, [deployment.root])
    views: list[BoardView] = []
    say(f"hold the board {HOW}; {FEWEST_PICTURES} pictures are the fewest")
    with (
        tempfile.TemporaryDirectory() as folder,
        occupied(rig.cid, "'dodo rig measure'", devices, say, options.wait) as query,
    ):
        path = Path(folder) / "snapshot.png"
        while len(views) < PICTURES:
            ask(f"picture {len(views) + 1} of {PICTURES}: hold the board still, and press Enter ")
            query((snapshot.program, [*snapshot.words, f"--output={path}"]))
            picture = _picture(path.read_bytes())
            seen = None if picture is None else view(picture)
            if seen is None:
                say(f"it shows fewer than {FEWEST_CORNERS} corners of the board: once more")
            else:
                views.append(seen)
    return views


def _numbers(found: Intrinsics) -> dict[str, tuple[float, int, str]]:
    """Name, value, decimals and unit."""
    return {
        "focal-x": (found.focal_x, 3, " px"),
        "focal-y": (found.focal_y, 3, " px"),
        "centre-x": (found.centre_x, 3, " px"),
        "centre-y": (found.centre_y, 3, " px"),
        "fovy": (found.fovy, 4, " deg"),
        "k1": (found.k1, 6, ""),
        "k2": (found.k2, 6, ""),
        "p1": (found.p1, 6, ""),
        "p2": (found.p2, 6, ""),
        "error": (found.error, 3, " px"),
    }


def _entry(found: Intrinsics) -> str:
    words = [f"width: {found.width}", f"height: {found.height}"]
    words += [f"{name}: {value:.{digits}f}{unit}" for name, (value, digits, unit) in _numbers(found).items()]
    return f"{{{', '.join(words)}}}"


def _camera_text(rig: Rig, found: Intrinsics, file: Path | None) -> str:
    numbers = [f"{name} {value:.{digits}f}{unit}" for name, (value, digits, unit) in _numbers(found).items()]
    said = f"{rig.name}: {found.pictures} pictures of {found.width} x {found.height}: {', '.join(numbers)}"
    written = f"written into {file}" if file else "nothing is written (--dry-run)"
    return f"{printable(said)}\nthe focal length is certain to ± {found.deviation:.2g} px\n{printable(written)}\n"


def _camera_json(rig: Rig, found: Intrinsics, file: Path | None) -> str:
    result: dict[str, Any] = {name: value for name, (value, _, _) in _numbers(found).items()}
    result |= {"width": found.width, "height": found.height, "deviation": found.deviation, "pictures": found.pictures}
    return json_text({"rig": rig.name, "camera": result, "written": str(file) if file else ""})
