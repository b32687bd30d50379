"""One picture and the truth about it: ``python -m services.virtual_camera.snapshot --output=FILE --map-path=...``.

It takes the virtual camera's flags, draws the picture where the vehicle starts (the map's origin when that is not
written) into a PNG, and prints one JSON object: ``width``, ``height`` and the true ``boxes``, each a ``class``, the
upper left corner ``x`` and ``y``, ``width`` and ``height`` in pixels. Exit codes: 0 done, 1 not (``error`` says why),
2 usage.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

from services.base.flags import load_manifest, parse
from services.base.pictures import snapshot
from services.scene.raster import Image
from services.scene.truth import TrueBox, open_truth
from services.virtual_camera.service import mounted_camera, open_scene

ORIGIN = tuple(f"--start-{name}=0" for name in ("x", "y", "yaw"))
NOW = 0


def main(argv: Sequence[str], stdout: TextIO) -> int:
    """Draw and write the picture; print the truth about it."""
    return snapshot(argv, stdout, _draw)


def _draw(words: list[str]) -> tuple[Image, dict[str, Any]]:
    """The picture (height, width, 4) and the true boxes in it."""
    start = () if any(word.startswith("--start-") for word in words) else ORIGIN
    flags = parse(load_manifest(Path(__file__).parent), [*words, *start, "--cid=1"])
    renderer, optics = open_scene(flags)
    truth = open_truth(flags, renderer, optics.lens)
    pictures: list[Image] = []
    camera = mounted_camera(flags, renderer, optics, lambda argb, _i420, _now: pictures.append(argb))
    pose = camera.update(NOW)
    assert pose is not None, "it starts somewhere"
    return pictures[0], {"boxes": [_as_json(box) for box in truth.boxes(pose)]}


def _as_json(box: TrueBox) -> dict[str, Any]:
    edges = {"x": box.left, "y": box.top, "width": box.width, "height": box.height}
    return {"class": box.name, **{name: round(value, 3) for name, value in edges.items()}}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], sys.stdout))
