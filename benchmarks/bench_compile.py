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


def main() -> int:
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "generated"
        compile_all = [sys.executable, "-m", "dodo_dsl", "compile", "-o", str(out)]
        quiet = {"cwd": ROOT, "check": True, "stdout": subprocess.DEVNULL}
        subprocess.run(compile_all, **quiet)  # type: ignore[call-overload]
        tests = sorted(p.parent for p in out.glob("*/test.json"))
        if not PLUGIN.is_file():
            print("Compose v2 is not installed: no peer to measure against")
            return 0
        ours, theirs = [], []
        for _ in range(ROUNDS):
            ours.append(seconds(lambda: subprocess.run(compile_all, **quiet)))  # type: ignore[call-overload]
            theirs.append(seconds(lambda: [_config(test) for test in tests]) / len(tests))
    compiled, peer = statistics.median(ours), statistics.median(theirs)
    print(
        f"dodo compile, {len(tests)} tests, cold start: {compiled * 1000:.0f} ms, {compiled / len(tests) * 1000:.0f} ms a test"
    )
    print(f"docker compose config -q:                {peer * 1000:.0f} ms a test")
    print(f"ratio a test:                            {peer / (compiled / len(tests)):.2f}")
    return 0


def _config(folder: Path) -> None:
    subprocess.run([PLUGIN, "config", "-q"], cwd=folder, check=True)


if __name__ == "__main__":
    sys.exit(main())
