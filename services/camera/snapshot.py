"""A picture of a camera: ``python -m services.camera.snapshot --output=FILE --source=...`` writes it as a PNG.

It takes the camera's flags and prints one JSON object: the result of ``services.camera.health_check``, its ``width``
and ``height``. Exit codes: 0 written, even if it fails the check (``reason``); 1 no picture (``error``).
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

from services.base.flags import load_manifest, parse
from services.base.pictures import snapshot
from services.base.process import interruptible
from services.camera.health_check import check, take_picture
from services.camera.picture import Image


def main(argv: Sequence[str], stdout: TextIO) -> int:
    return int(snapshot(argv, stdout, _take) != 0)


def _take(words: list[str]) -> tuple[Image, dict[str, Any]]:
    flags = parse(load_manifest(Path(__file__).parent), [*words, "--cid=1"])
    with interruptible():
        picture = take_picture(flags)
    return picture.argb, check(picture)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], sys.stdout))
