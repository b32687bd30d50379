"""Compiling and checking 10, 100 and 1,000 instances, beside ``docker compose config -q`` on the output.

Each number of instances is compiled twice: as one spec with a matrix, and as as many specs. Everything is written
below the system's temporary folder, so its file system has a share in the figures; ``--check`` writes nothing.
"""

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
PLUGIN = Path.home() / ".docker/cli-plugins/docker-compose"
SPEC = ROOT / "tests_registry" / "sil-closed-straight" / "sil-closed-straight.dodo.yml"
NUMBERS = (1, 10, 100, 1000)
ROUNDS = 5
PEER_CALLS = 10


def write_specs(folder: Path, name: str, number: int, matrix: bool) -> None:
    """A registry of so many instances; each has its own yaw."""
    yaws = [f"{80 + 10 * i / number:.6f} deg" for i in range(number)]
    text = SPEC.read_text()
    specs = {}
    if matrix:
        specs[name] = text.replace("84 deg", '"${matrix.yaw}"') + f"matrix: {{yaw: [{', '.join(yaws)}]}}\n"
    else:
        specs = {f"{name}-{i}": text.replace("84 deg", yaw) for i, yaw in enumerate(yaws)}
    for spec, body in specs.items():
        path = folder / "tests" / spec / f"{spec}.dodo.yml"
        path.parent.mkdir(parents=True)
        path.write_text(body.replace("name: sil-closed-straight", f"name: {spec}"))
    shutil.copytree(ROOT / "tests_registry" / "maps", folder / "tests" / "maps")
    shutil.copytree(ROOT / "examples" / "kiwi", folder / "kiwi")
    (folder / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: kiwi/docker-compose.yml\n")


def compiled(folder: Path, *words: str) -> tuple[float, float]:
    """Seconds of one cold call, and its peak memory in MiB."""
    process = subprocess.Popen(
        [sys.executable, "-m", "dodo_dsl", "compile", *words], cwd=folder, stdout=subprocess.DEVNULL
    )
    start = time.perf_counter()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"dodo compile {' '.join(words)} ended with {process.returncode}")
    return time.perf_counter() - start, usage.ru_maxrss / 1024


def peer(folder: Path) -> float:
    """Seconds that compose takes to check one compiled test."""
    tests = sorted(p.parent for p in (folder / "generated").glob("*/test.json"))[:PEER_CALLS]
    start = time.perf_counter()
    for test in tests:
        subprocess.run([PLUGIN, "config", "-q"], cwd=test, check=True)
    return (time.perf_counter() - start) / len(tests)


def measure(number: int, matrix: bool) -> tuple[float, float, float, float]:
    """Medians: seconds to check, seconds to compile afresh, peak MiB, seconds of the peer a test."""
    checks, writes, peaks, peers = [], [], [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_specs(folder, "bench", number, matrix)
        for turn in range(ROUNDS):
            checks.append(compiled(folder, "--check", "-o", "absent")[0])
            seconds, peak = compiled(folder, *([] if turn == 0 else ["-o", f"generated-{turn}"]))
            writes.append(seconds)
            peaks.append(peak)
            peers.append(peer(folder))
    return tuple(statistics.median(column) for column in (checks, writes, peaks, peers))  # type: ignore[return-value]


def main() -> int:
    if not PLUGIN.is_file():
        print("Compose v2 is not installed: no peer to measure against")
        return 0
    print("instances         check    compile   a test after start-up (check, compile)   peak    peer a test   ratio")
    for matrix in (True, False):
        base_check = base_write = 0.0
        for number in NUMBERS:
            check, write, peak, other = measure(number, matrix)
            if number == 1:
                base_check, base_write = check, write
                continue
            each, written = (check - base_check) / (number - 1), (write - base_write) / (number - 1)
            kind = "of a matrix" if matrix else "specs"
            after = f"{each * 1000:10.2f} ms {written * 1000:10.2f} ms"
            ratio = other / (write / number)
            print(f"{number:5d} {kind:11s} {check:6.2f} s  {write:6.2f} s   {after}          {peak:6.0f} MiB"
                  f"  {other * 1000:6.1f} ms   {ratio:6.1f}")  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
