"""One picture and the truth about it: ``python -m services.virtual_camera.snapshot --output=FILE --map-path=...``.

It takes the virtual camera's flags, draws the picture where the vehicle starts (the map's origin when that is not
written) into a PNG, and prints one JSON object: ``width``, ``height`` and the true ``boxes``, each a ``class``, the
upper left corner ``x`` and ``y``, ``width`` and ``height`` in pixels. Exit codes: 0 done, 1 not (``error`` says why),
2 usage.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

import cv2

from services.base import Flags
from services.base.flags import load_manifest, parse
from services.scene.raster import Image
from services.scene.truth import TrueBox, open_truth
from services.virtual_camera.service import mounted_camera, open_scene

OUTPUT = "--output="
ORIGIN = tuple(f"--start-{name}=0" for name in ("x", "y", "yaw"))
NOW = 0


def main(argv: Sequence[str], stdout: TextIO) -> int:
    """Draw and write the picture; print the truth about it."""
    try:
        result, code = write_picture(argv), 0
    except (ValueError, OSError) as error:
        result, code = {"error": " ".join(str(error).split())}, 2 if isinstance(error, ValueError) else 1
    stdout.write(json.dumps(result) + "\n")
    return code


def write_picture(argv: Sequence[str]) -> dict[str, Any]:
    """Facts about the picture that was written; raises InputError, ValueError and OSError."""
    outputs = [word.removeprefix(OUTPUT) for word in argv if word.startswith(OUTPUT)]
    if len(outputs) != 1:
        raise ValueError(f"expected {OUTPUT}FILE once: the PNG to write")
    words = [word for word in argv if not word.startswith(OUTPUT)]
    if not any(word.startswith("--start-") for word in words):
        words += ORIGIN
    picture, boxes = _draw(parse(load_manifest(Path(__file__).parent), [*words, "--cid=1"]))
    done, png = cv2.imencode(".png", picture[..., :3])
    if not done:
        raise OSError("the picture cannot be encoded as a PNG")
    Path(outputs[0]).write_bytes(png.tobytes())
    return {"width": picture.shape[1], "height": picture.shape[0], "boxes": boxes}


def _draw(flags: Flags) -> tuple[Image, list[dict[str, Any]]]:
    """The picture (height, width, 4) and the true boxes in it."""
    renderer, optics = open_scene(flags)
    truth, _ = open_truth(flags, renderer, optics.lens)
    pictures: list[Image] = []
    camera = mounted_camera(flags, renderer, optics, lambda argb, _i420, _now: pictures.append(argb))
    pose = camera.update(NOW)
    assert pose is not None, "it starts somewhere"
    return pictures[0], [_as_json(box) for box in truth.boxes(pose)]


def _as_json(box: TrueBox) -> dict[str, Any]:
    edges = {"x": box.left, "y": box.top, "width": box.width, "height": box.height}
    return {"class": box.name, **{name: round(value, 3) for name, value in edges.items()}}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], sys.stdout))
