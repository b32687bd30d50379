"""Whether a camera is alive and lit: ``python -m services.camera.health_check --source=...`` prints one JSON object.

It takes the camera's flags. Exit codes: 0 it is, 1 it is not (``reason``) or gives no picture (``error``). With
``--output=FILE`` the picture becomes a PNG, which may fail the check, and the object has its ``width`` and ``height``.
"""

import contextlib
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from dodo_dsl.opendlv.pixels import Picture
from services.base import Flags
from services.base.flags import load_manifest, parse
from services.base.pictures import OUTPUT, snapshot
from services.base.process import interruptible
from services.camera.service import open_camera
from services.camera.sources import FIRST, CameraError, FileCamera, Grabber, SharedPicture

BRIGHTNESS = 0.04, 0.97
"""Mean brightness of a lit picture, as a share of white."""
BLACK, WHITE = 16.0, 235.0
"""Of the Y plane (BT.601)."""
SETTLED = 1.0
"""s after the first picture until exposure and white balance have settled."""
CONTRAST = 0.02
"""Least standard deviation of brightness: a covered lens or a blown picture has less."""


def main(argv: Sequence[str], stdout: TextIO) -> int:
    if any(word.startswith(OUTPUT) for word in argv):
        return int(snapshot(argv, stdout, _take) != 0)
    try:
        _, result = _take(argv)
    except CameraError as error:
        result = {"ok": False, "reason": " ".join(str(error).split())}
    except (ValueError, OSError) as error:
        result = {"ok": False, "error": " ".join(str(error).split())}
    stdout.write(json.dumps(result) + "\n")
    return 0 if result["ok"] else 1


def _take(words: Sequence[str]) -> tuple[Picture, dict[str, Any]]:
    flags = parse(load_manifest(Path(__file__).parent), [*words, "--cid=1"])
    with interruptible():
        picture = take_picture(flags)
    return picture.argb, check(picture)


def check(picture: SharedPicture) -> dict[str, Any]:
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


def take_picture(flags: Flags) -> SharedPicture:
    """A picture of the camera that the flags name; raises ValueError and OSError, and CameraError when it is not alive.

    A live camera has settled by then, and has shown another picture before.
    """
    camera = open_camera(flags)
    if isinstance(camera, FileCamera):
        with contextlib.closing(camera):
            return camera.take()
    with contextlib.closing(Grabber(camera, flags["source"])) as grabber:
        first = _next(grabber, flags["source"])
        end = time.monotonic() + SETTLED
        while time.monotonic() < end:
            first = _next(grabber, flags["source"])
        while (other := _next(grabber, flags["source"])) and np.array_equal(other.i420, first.i420):
            if time.monotonic() - end > FIRST:
                raise CameraError(f"the camera {flags['source']} has shown the same picture for {FIRST:g} s")
        return other


def _next(grabber: Grabber, name: str) -> SharedPicture:
    if not grabber.wait(FIRST) or (picture := grabber.take()) is None:
        raise CameraError(f"the camera {name} gave no picture for {FIRST:g} s")
    return picture


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], sys.stdout))
