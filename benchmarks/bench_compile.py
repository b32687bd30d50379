"""Compiling and checking the registry, cold start included, beside ``docker compose config -q`` on the output."""

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[1]
PLUGIN = Path.home() / ".docker/cli-plugins/docker-compose"
ROUNDS = 7


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def compile_all(out: Path) -> None:
    command = [sys.executable, "-m", "dodo_dsl", "compile", "-o", str(out)]
    subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)


def config(folder: Path) -> None:
    subprocess.run([PLUGIN, "config", "-q"], cwd=folder, check=True)


def main() -> int:
    if not PLUGIN.is_file():
        print("Compose v2 is not installed: no peer to measure against")
        return 0
    ours, theirs = [], []
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "generated"
        compile_all(out)
        tests = sorted(p.parent for p in out.glob("*/test.json"))
        for _ in range(ROUNDS):
            ours.append(seconds(lambda: compile_all(out)))
            theirs.append(seconds(lambda: [config(test) for test in tests]) / len(tests))
    own, peer = statistics.median(ours) / len(tests), statistics.median(theirs)
    print(f"dodo compile, {len(tests)} tests, cold start: {own * 1000:6.1f} ms a test")
    print(f"docker compose config -q:          {peer * 1000:6.1f} ms a test")
    print(f"the peer takes {peer / own:.2f} times as long a test")
    return 0


if __name__ == "__main__":
    sys.exit(main())
