"""dodo rig board: the board by which a camera is measured, to be printed."""

import argparse
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.atomic import refuse_existing
from dodo_dsl.cli.errors import UsageError

SUMMARY = "write the board for measuring a camera, to be printed"
EXAMPLES = """examples:
  dodo rig board -o board.svg           A4, in true size; print it without scaling
"""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-o", "--output", metavar="FILE.svg", type=Path, required=True, help="file to write")
    parser.add_argument("--force", action="store_true", help="replace an existing file")


def make(options: argparse.Namespace) -> str:
    """Writes the board; a sentence about it. Raises UsageError, OutputExists and OSError."""
    from dodo_dsl.run.rigs import camera_calibration  # OpenCV takes a second to import

    if options.output.suffix.lower() != ".svg":
        raise UsageError(f"'{options.output}' is not the name of an SVG file, expected one that ends in .svg")
    refuse_existing([options.output], options.force)
    atomic.write_text(options.output, camera_calibration.svg())
    squares = f"{camera_calibration.COLUMNS} x {camera_calibration.ROWS} squares of {camera_calibration.SQUARE:g} mm"
    return f"{options.output}: {squares} on A4; print it without scaling, and glue it onto something flat"
