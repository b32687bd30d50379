"""One of the examples' programs with a fault; others of its flags are handed on.

python tests/faulty/program.py steering --fault=steering-reversed --cid=111
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.faulty.kiwi import program
from tests.faulty.makes import GOOD, PROGRAMS, fault_of


def main() -> int:
    parser = argparse.ArgumentParser(description="One of the examples' programs with a fault.")
    parser.add_argument("program", choices=PROGRAMS)
    parser.add_argument("--fault", default=GOOD, help="what is wrong with it: NAME, or CID=NAME,CID=NAME by its bus")
    parser.add_argument("--cid", required=True, help="the bus")
    flags, words = parser.parse_known_args()
    sys.argv[1:] = [f"--cid={flags.cid}", *words]
    try:
        make = PROGRAMS[flags.program].get(fault_of(flags.fault, flags.cid))
    except ValueError as problem:
        parser.error(str(problem))
    module = program(flags.program)
    if make:
        make(module)
    return int(module.main())


if __name__ == "__main__":
    sys.exit(main())
