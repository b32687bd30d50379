"""The registry's tests in lockstep beside the same in real time, with the example application, one after the other.

Prints test time over wall time of each (sim_s / execution_s, in real time about 1), where the wall time of a step went,
and the whole suite's time. The target is 10 times real time at 640 x 480 pixels and 10 Hz.
"""

import json
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
ROUNDS = 3
_SPENT = re.compile(r"(?P<who>[^,]+?) (?P<seconds>\d+\.\d+) s")


def run(clock: str, report: Path) -> tuple[dict[str, dict[str, Any]], float]:
    """The tests' results by slug, and the command's seconds."""
    command = [sys.executable, "-m", "dodo_dsl", "run", "--level", "sil", "--level", "dil", "-j", "1"]
    start = time.perf_counter()
    words = ["--clock", clock, "--report", str(report)]
    subprocess.run([*command, *words], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    seconds = time.perf_counter() - start
    return {t["slug"]: t for t in json.loads((report / "results.json").read_text())["tests"]}, seconds


def spent(report: Path, slug: str) -> str:
    """For whom the clock waited, in ms a step, the longest first."""
    log = (report / slug / "logs" / "environment.dodo-clock.log").read_text()
    line = next(line for line in log.splitlines() if "waited for" in line)
    frames = max(json.loads(line)["frames"] for line in log.splitlines() if line.startswith('{"dodo": "time"'))
    parts = [(m["who"].strip(), float(m["seconds"])) for m in _SPENT.finditer(line.partition("waited for")[2])]
    return ", ".join(f"{who} {seconds / frames * 1000:.1f}" for who, seconds in parts[:6])


def main() -> int:
    with tempfile.TemporaryDirectory() as name:
        report = Path(name)
        peer, peer_s = run("realtime", report / "realtime")
        rounds = [run("lockstep", report / str(number)) for number in range(ROUNDS)]
        print(f"{'test':24s} real time  lockstep    test time   times real time (median of {ROUNDS}, best)")
        for slug, test in peer.items():
            ours = [tests[slug] for tests, _ in rounds]
            speeds = [t["sim_s"] / t["execution_s"] for t in ours]
            execution = statistics.median(t["execution_s"] for t in ours)
            times = f"{test['execution_s']:7.1f} s {execution:7.2f} s {ours[0]['sim_s']:9.1f} s"
            print(f"{slug:24s} {times}   {statistics.median(speeds):6.1f} {max(speeds):6.1f}")
            print(f"    ms a step: {spent(report / '0', slug)}")
        suite = statistics.median(seconds for _, seconds in rounds)
    print(f"the suite, one after the other: {peer_s:.1f} s in real time, {suite:.1f} s in lockstep")
    return 0


if __name__ == "__main__":
    sys.exit(main())
