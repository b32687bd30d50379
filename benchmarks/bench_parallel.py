"""Real-time tests at once against one after the other: python benchmarks/bench_parallel.py [TESTS].

Closed loops with pictures of 320x240 at 10 Hz and the example application, on the process backend. Prints how long both
ways take, and their ratio: with N tests, N times as fast is the most that there can be. All of them have to pass.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TESTS = 8
SMALL = {"width: 640": "width: 320", "height: 480": "height: 240"}


def small(folder: Path, tests: int) -> None:
    """A repository with so many instances of a closed loop with small pictures."""
    shutil.copytree(ROOT / "tests_registry" / "maps", folder / "tests" / "maps")
    shutil.copytree(ROOT / "examples" / "kiwi", folder / "app")
    spec = (ROOT / "tests_registry" / "sil-closed-straight" / "sil-closed-straight.dodo.yml").read_text()
    for large, less in {**SMALL, "sil-closed-straight": "small", "z: 9.5 cm": "z: 9.5 cm, seed: '${matrix.n}'"}.items():
        spec = spec.replace(large, less)
    numbers = ", ".join(map(str, range(1, tests + 1)))
    path = folder / "tests" / "small" / "small.dodo.yml"
    path.parent.mkdir()
    path.write_text(f"{spec}matrix: {{n: [{numbers}]}}\n")
    compose = folder / "app" / "docker-compose.yml"
    compose.write_text(compose.read_text().replace("--width=640 --height=480", "--width=320 --height=240"))
    (folder / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: app/docker-compose.yml\n")


def run(folder: Path, jobs: int) -> float:
    """Seconds of ``dodo run`` with so many jobs; raises AssertionError when a test does not pass."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "DODO_HISTORY": str(folder / "history.jsonl")}
    began = time.monotonic()
    command = [sys.executable, "-m", "dodo_dsl", "run", "--clock", "realtime", "-j", str(jobs)]
    subprocess.run(command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, check=False)
    took = time.monotonic() - began
    tests = json.loads((folder / "dodo-report" / "results.json").read_text())["tests"]
    wrong = [f"{t['slug']}: {t['reason']}" for t in tests if t["outcome"] != "passed"]
    times = [t["execution_s"] for t in tests]
    print(f"{jobs} at once: {took:.1f} s, each {min(times):.2f} to {max(times):.2f} s; not passed: {wrong or 'none'}")
    return took


def main() -> int:
    tests = int(sys.argv[1]) if len(sys.argv) > 1 else TESTS
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        small(folder, tests)
        together, alone = run(folder, tests), run(folder, 1)
    print(f"{tests} tests on {os.cpu_count()} cores: {alone / together:.2f} times as fast as one after the other")
    return 0


if __name__ == "__main__":
    sys.exit(main())
