"""Whether a camera is alive and lit: ``python -m services.camera.check --source=...`` prints one JSON object.

It takes the camera's flags. Exit codes: 0 it is, 1 it is not (``reason`` or ``error`` says why).
"""

import contextlib
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

from services.base import Flags
from services.base.flags import parse
from services.base.manifest import load_manifest
from services.base.signals import interruptible
from services.camera.files import FileCamera
from services.camera.grabber import SILENCE, Grabber
from services.camera.picture import CameraError, Picture
from services.camera.service import open_camera

BRIGHTNESS = 0.04, 0.97
"""Mean brightness of a lit picture, as a share of white."""
BLACK, WHITE = 16.0, 235.0
"""Of the Y plane (BT.601)."""
CONTRAST = 0.02
"""Least standard deviation of brightness: a covered lens or a blown picture has less."""


def main(argv: Sequence[str], stdout: TextIO) -> int:
    """Takes a picture and judges it."""
    try:
        flags = parse(load_manifest(Path(__file__).parent), [*argv, "--cid=1"])
        with interruptible():
            said = judged(looked(flags))
    except (ValueError, OSError, CameraError) as error:
        said = {"ok": False, "error": " ".join(str(error).split())}
    stdout.write(json.dumps(said) + "\n")
    return 0 if said["ok"] else 1


def judged(picture: Picture) -> dict[str, Any]:
    """``ok``, ``reason``, and brightness and contrast as shares of white."""
    luma = (picture.i420[: picture.i420.shape[0] * 2 // 3] - BLACK) / (WHITE - BLACK)
    brightness, contrast = round(float(luma.mean()), 4), round(float(luma.std()), 4)
    low, high = BRIGHTNESS
    reason = ""
    if not low <= brightness <= high:
        reason = (
            f"the camera's picture has a brightness of {brightness:.1%}, expected {low:.0%} to {high:.0%}: is it lit?"
        )
    elif contrast < CONTRAST:
        reason = f"the camera's picture has a contrast of {contrast:.1%}, expected {CONTRAST:.0%}: is the lens covered?"
    return {"ok": not reason, "reason": reason, "brightness": brightness, "contrast": contrast}


def looked(flags: Flags) -> Picture:
    """A picture of the camera that the flags name; raises ValueError, OSError and CameraError."""
    camera = open_camera(flags)
    if isinstance(camera, FileCamera):
        with contextlib.closing(camera):
            return camera.read()
    with contextlib.closing(Grabber(camera, flags["source"])) as grabber:
        if not grabber.wait(SILENCE) or (picture := grabber.take()) is None:
            raise CameraError(f"the camera {flags['source']} has given no picture for {SILENCE:g} s")
        return picture


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], sys.stdout))
