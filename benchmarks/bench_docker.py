"""A test on the docker backend beside ``docker compose up --exit-code-from`` of the same compiled test.

Both drive the same car for the same time; what differs is set-up and teardown. The images must exist
(``dodo images build``).
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
TEST = "sil-closed-straight"
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
        seconds([*dodo, "compile", TEST, "-o", str(out)], folder=ROOT)
        up = ["docker", "compose", "up", "--exit-code-from", "track"]
        down = ["docker", "compose", "down", "-v"]
        for _ in range(ROUNDS):
            run = [*dodo, "run", TEST, "--backend", "docker", "--report", str(report)]
            ours = seconds(run, folder=ROOT)
            (test,) = json.loads((report / "results.json").read_text())["tests"]
            rows.append((ours, test["setup_s"], test["execution_s"], seconds(up, down, folder=out / TEST)))
    total, setup, execution, peer = (statistics.median(column) for column in zip(*rows, strict=True))
    rest = total - setup - execution
    parts = f"set-up {setup:.1f} s, test {execution:.1f} s, the rest {rest:.1f} s"
    print(f"dodo run --backend docker: {total:5.1f} s: {parts}")
    print(f"docker compose up and down: {peer:4.1f} s")
    print(f"ratio: {peer / total:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
