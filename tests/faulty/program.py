"""One of the example's programs with a fault.

python tests/faulty/program.py steering --fault=steering-reversed --cid=111
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.faulty.kiwi import program
from tests.faulty.makes import GOOD, MAKES, NAMES


def main() -> int:
    parser = argparse.ArgumentParser(description="One of the example's programs with a fault.")
    parser.add_argument("program", choices=MAKES)
    parser.add_argument("--fault", choices=[GOOD, *NAMES], default=GOOD, help="what is wrong with it")
    flags, sys.argv[1:] = parser.parse_known_args()
    module = program(flags.program)
    make = MAKES[flags.program].get(flags.fault)
    if make:
        make(module)
    return int(module.main())


if __name__ == "__main__":
    sys.exit(main())
