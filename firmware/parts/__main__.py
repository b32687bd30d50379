"""Writes the parts: scripts/make-rig-parts."""

import argparse
from pathlib import Path

from firmware.parts import parts


def main() -> None:
    parser = argparse.ArgumentParser(prog="make-rig-parts", description="write the rig's printed parts as STL, in mm")
    parser.add_argument("folder", type=Path, metavar="DIR", help="where the files go")
    for file in parts.write(parser.parse_args().folder):
        print(file)


if __name__ == "__main__":
    main()
