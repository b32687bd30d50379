"""Whether a search that is killed at ten random moments and goes on each time finds what one that runs through finds.

    python benchmarks/planted/killed.py [BUG] [--runs 40] [--kills 10] [--work build/planted]

Only the process of `dodo search` gets SIGKILL, as by a machine without memory; the next one ends what it left behind.
"""

import argparse
import random
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from programs import DODO, ROOT, prepare  # noqa: E402

RESULT = Path("dodo-report", "search", "planted", "search.json")


def search(folder: Path, runs: int) -> "subprocess.Popen[bytes]":
    words = [*DODO, "search", "planted", "--runs", str(runs)]
    return subprocess.Popen(words, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def main() -> int:
    parser = argparse.ArgumentParser(description="Kill a search at random moments.")
    parser.add_argument("bug", nargs="?", default="dark-late")
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "planted")
    flags = parser.parse_args()
    through, killed = (flags.work.resolve() / f"{flags.bug}-{name}" for name in ("through", "killed"))
    for folder in (through, killed):
        prepare(flags.bug, folder)
    begin = time.monotonic()
    search(through, flags.runs).wait()
    seconds = time.monotonic() - begin
    moments = random.Random(0)
    for number in range(flags.kills):
        process = search(killed, flags.runs)
        wait = moments.uniform(0.2, 2 * seconds / flags.kills)
        try:
            process.wait(wait)
            print(f"kill {number + 1}: it had ended before {wait:.1f} s", flush=True)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            print(f"kill {number + 1}: after {wait:.1f} s", flush=True)
    search(killed, flags.runs).wait()
    same = (through / RESULT).read_bytes() == (killed / RESULT).read_bytes()
    print(f"{flags.runs} drives in {seconds:.0f} s; the results are {'equal' if same else 'different'}")
    return not same


if __name__ == "__main__":
    sys.exit(main())
