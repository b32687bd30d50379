"""Writes the drawings, or the parts: scripts/make-rig-drawings."""

import argparse
from pathlib import Path

from firmware.drawings import drawings, parts

PAGES = Path(__file__).parents[2] / "docs" / "rigs"


def main() -> None:
    parser = argparse.ArgumentParser(prog="make-rig-drawings", description="draw the rig into docs/rigs")
    parser.add_argument("--parts", type=Path, metavar="DIR", help="write the parts to be printed there instead, as STL")
    folder = parser.parse_args().parts
    for file in parts.write(folder) if folder else drawings.write(PAGES):
        print(file)


if __name__ == "__main__":
    main()
