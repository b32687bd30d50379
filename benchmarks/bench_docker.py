"""The closed-loop tests on the docker backend, at once, beside ``docker compose up`` of the same one after the other.

Both drive the same cars for the same time. The images must exist (``dodo images build``).
"""

import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
TESTS = ("sil-closed-left-curve", "sil-closed-straight")
ROUNDS = 3


def seconds(*commands: Sequence[str], folder: Path) -> float:
    start = time.perf_counter()
    for command in commands:
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.perf_counter() - start


def main() -> int:
    if subprocess.run(["docker", "info"], capture_output=True, check=False).returncode:
        print("no Docker engine answers: nothing to measure")
        return 0
    dodo = [sys.executable, "-m", "dodo_dsl"]
    rows = []
    with tempfile.TemporaryDirectory() as name:
        out, report = Path(name) / "generated", Path(name) / "report"
        seconds([*dodo, "compile", *TESTS, "-o", str(out)], folder=ROOT)
        up = ["docker", "compose", "up", "--exit-code-from", "track"]
        down = ["docker", "compose", "down", "-v"]
        for _ in range(ROUNDS):
            run = [*dodo, "run", *TESTS, "--backend", "docker", "-j", str(len(TESTS)), "--report", str(report)]
            ours = seconds(run, folder=ROOT)
            tests = json.loads((report / "results.json").read_text())["tests"]
            setup, execution = (max(test[key] for test in tests) for key in ("setup_s", "execution_s"))
            rows.append((ours, setup, execution, sum(seconds(up, down, folder=out / test) for test in TESTS)))
    total, setup, execution, peer = (statistics.median(column) for column in zip(*rows, strict=True))
    parts = f"set-up {setup:.1f} s, test {execution:.1f} s, the rest {total - setup - execution:.1f} s"
    print(f"dodo run --backend docker, {len(TESTS)} at once:   {total:5.1f} s: {parts}")
    print(f"docker compose up and down, one by one: {peer:5.1f} s")
    print(f"the peer takes {peer / total:.2f} times as long")
    return 0


if __name__ == "__main__":
    sys.exit(main())
