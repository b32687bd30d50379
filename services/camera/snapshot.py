"""A picture of a camera: ``python -m services.camera.snapshot --output=FILE --source=...`` writes it as a PNG.

It takes the camera's flags and prints one JSON object: the result of ``services.camera.health_check``, its ``width``
and ``height``. Exit codes: 0 written, even if it fails the check (``reason``); 1 no picture (``error``).
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

import cv2

from services.base.flags import load_manifest, parse
from services.base.process import interruptible
from services.camera.health_check import check, take_picture
from services.camera.picture import CameraError

OUTPUT = "--output="


def main(argv: Sequence[str], stdout: TextIO) -> int:
    """Take a picture, write it and print the result."""
    try:
        result = write_picture(argv)
    except (ValueError, OSError, CameraError) as error:
        result = {"ok": False, "error": " ".join(str(error).split())}
    stdout.write(json.dumps(result) + "\n")
    return int("error" in result)


def write_picture(argv: Sequence[str]) -> dict[str, Any]:
    """Facts about the picture that was written; raises ValueError, OSError and CameraError."""
    outputs = [word.removeprefix(OUTPUT) for word in argv if word.startswith(OUTPUT)]
    if len(outputs) != 1:
        raise ValueError(f"expected {OUTPUT}FILE once: the PNG to write")
    words = [word for word in argv if not word.startswith(OUTPUT)]
    flags = parse(load_manifest(Path(__file__).parent), [*words, "--cid=1"])
    with interruptible():
        picture = take_picture(flags)
    done, png = cv2.imencode(".png", picture.argb[..., :3])
    if not done:
        raise OSError("the picture cannot be encoded as a PNG")
    Path(outputs[0]).write_bytes(png.tobytes())
    height, width = picture.argb.shape[:2]
    return {**check(picture), "width": width, "height": height}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], sys.stdout))
