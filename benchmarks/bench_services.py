"""What the services cost, and how soon an application answers: no peer, but what a test on this machine leaves to it.

    python benchmarks/bench_services.py [SECONDS]

Processor time (user and system, of all threads) a second of each service at its default rate, in percent of a core.
All that a simulated test can have runs at once and drives the example application around the Kiwi track; camera,
beacon, gantry and rec-replay run after it. In the drive the time is taken from an image of 640 x 480 being in shared
memory, when its readers are notified, to GroundSteeringRequest for this image being received; and from the instant at
which the image was due, which includes drawing it.
"""

import itertools
import os
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Row, attempt, cost_row, plan, report
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError
from tests.services.gantry.fake_rig import FakeRig

ROOT = Path(__file__).resolve().parents[1]
CID = 126
REQUEST = "opendlv.proxy.GroundSteeringRequest"
MAP = "--map-path=tests_registry/maps/kiwi-track"
SETTLE = 3.0
PARTS = 4  # of the drive, which are the rounds of the ledger
LONG, SHORT = 40.0, 8.0  # seconds of the drive, alone and in the ledger
TICKS = os.sysconf("SC_CLK_TCK")
LATENCIES = ("image in memory to request", "image due to request")
Shares = dict[str, list[float]]
Processes = dict[str, "subprocess.Popen[bytes]"]


def in_the_drive(memory: str, folder: Path) -> dict[str, list[str]]:
    """Services and programs of the drive with their flags; evaluators that do not end within it."""
    long = "--max-time=3600"
    return {
        "collision": [MAP, "--walls=left,right", "--min-distance=0", long],
        "continuous_signal": [
            f"--message={REQUEST}", "--field=groundSteering", "--target=tests_registry/targets/left-curve.csv",
            "--max-mean=1", long,
        ],
        "object_detection": ["--truth=tests_registry/truths/static-rig.json", "--min-f1=0.1", long],
        "rec_recorder": [f"--rec={folder / 'drive.rec'}"],
        "dynamic_model": [],
        "integrator": ["--yaw=90"],
        "virtual_camera": [MAP, "--z=0.095", f"--name.argb={memory}.argb", f"--name.i420={memory}.i420"],
        "perception": [f"--name={memory}.argb", "--width=640", "--height=480"],
        "steering": [],
    }  # fmt: skip


def alone(memory: str, rig: FakeRig) -> dict[str, list[str]]:
    """Services that play their own part."""
    return {
        "beacon": ["--start=at-once", "--points=0 0,1000 0", "--speed=1"],
        "camera": [
            "--source=file", "--file=tests_registry/recordings/static-rig.rec",
            f"--name.argb={memory}.a", f"--name.i420={memory}.b",
        ],
        "gantry": [f"--serial={rig.path}"],
        "rec_replay": [
            "--rec=tests_registry/recordings/static-rig.rec", "--await-begin=false", "--autorewind",
            f"--name.argb={memory}.c", f"--name.i420={memory}.d",
        ],
    }  # fmt: skip


@contextmanager
def running(programs: dict[str, list[str]], folder: Path) -> Iterator[Processes]:
    """All of them, ready, and settled."""
    processes: Processes = {}
    try:
        for name, flags in programs.items():
            own = ["-m", f"services.{name}"] if (ROOT / "services" / name).is_dir() else [f"examples/kiwi/{name}.py"]
            environment = {**os.environ, "PYTHONPATH": str(ROOT)}
            processes[name] = subprocess.Popen(
                [sys.executable, *own, f"--cid={CID}", *flags], cwd=ROOT, env=environment, stdout=subprocess.PIPE
            )
            if own[0] == "-m" and processes[name].stdout.readline() != b'{"dodo": "ready"}\n':  # type: ignore[union-attr]
                raise RuntimeError(f"{name} did not become ready")
        time.sleep(SETTLE)
        yield processes
    finally:
        for process in processes.values():
            process.terminate()
        for process in processes.values():
            process.communicate()


def used(processes: Processes) -> dict[str, float]:
    """Processor seconds that each has used."""
    fields = {name: Path(f"/proc/{p.pid}/stat").read_text().rpartition(")")[2].split() for name, p in processes.items()}
    return {name: (int(field[11]) + int(field[12])) / TICKS for name, field in fields.items()}


class Watcher:
    """Notes when readers were notified of each image of a memory, by sample time, in us of the wall clock."""

    def __init__(self, name: str) -> None:
        self.shown: dict[int, int] = {}
        self._memory, self._over = SharedMemory.attach(name), False
        self._thread = threading.Thread(target=self._watch)
        self._thread.start()

    def _watch(self) -> None:
        with suppress(SharedMemoryError):
            while not self._over:
                if self._memory.wait(0.5):
                    now = time.time_ns() // 1000
                    with self._memory.lock():
                        self.shown.setdefault(self._memory.sample_time(), now)

    def close(self) -> None:
        self._over = True
        self._thread.join()
        self._memory.close()


def answers(session: Session, seconds: float) -> dict[int, int]:
    """When the request for each image came, by the image's sample time."""
    heard: dict[int, int] = {}
    wanted, end = session.messages.id(REQUEST), time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        envelope = session.receive(left)
        if envelope is not None and envelope.data_type == wanted:
            heard.setdefault(envelope.sample_time, envelope.received)
    return heard


def show(name: str, milliseconds: Sequence[float]) -> None:
    report(cost_row(name, "ms", [float(np.median(part)) for part in np.array_split(milliseconds, PARTS)]))
    half, most, nearly_all = np.percentile(milliseconds, (50, 95, 99))
    print(f"{name}: median {half:.1f} ms, 95 % {most:.1f} ms, 99 % {nearly_all:.1f} ms ({len(milliseconds)} images)")


def measured(programs: dict[str, list[str]], folder: Path, seconds: float, memory: str | None) -> Shares:
    """Percent of a core of each in each part of the time; with a memory, prints the latencies of its images, too."""
    heard: dict[int, int] = {}
    with running(programs, folder) as processes, Session(CID) as session, ExitStack() as stack:
        watcher = Watcher(memory) if memory else None
        if watcher is not None:
            stack.callback(watcher.close)
        marks = [(time.monotonic(), used(processes))]
        for _ in range(PARTS):
            heard = answers(session, seconds / PARTS) | heard
            marks.append((time.monotonic(), used(processes)))
        ended = [name for name, process in processes.items() if process.poll() is not None]
    if ended:
        raise RuntimeError(f"ended too soon: {', '.join(ended)}")
    if watcher is not None:
        both = sorted(heard.keys() & watcher.shown.keys())
        show(LATENCIES[0], [(heard[time] - watcher.shown[time]) / 1000 for time in both])
        show(LATENCIES[1], [(heard[time] - time) / 1000 for time in both])
        print(f"images: {len(watcher.shown)} seen, {len(both)} answered")
    spans = list(itertools.pairwise(marks))
    return {n: [100 * (b[n] - a[n]) / (end - begin) for (begin, a), (end, b) in spans] for n in processes}


def share_row(name: str, parts: Sequence[float]) -> Row:
    return cost_row(f"{name.replace('_', '-')}, processor", "% of a core", parts)


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else SHORT if Budget.given().limited else LONG
    memory = f"bench-{uuid.uuid4().hex[:8]}"
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        shares: Shares = {}
        with FakeRig(folder / "rig") as rig:
            drive, others = in_the_drive(memory, folder), alone(memory, rig)
            waits = [cost_row(name, "ms", []) for name in LATENCIES]
            plan(*waits, *(share_row(name, []) for name in (*drive, *others)))
            for programs, time_s, watched, rows in (
                (drive, seconds, f"{memory}.argb", waits),
                (others, seconds / 2, None, []),
            ):
                with attempt(*rows, *(share_row(name, []) for name in programs)):
                    found = measured(programs, folder, time_s, watched)
                    report(*(share_row(name, parts) for name, parts in found.items()))
                    shares.update(found)
    print(f"processor, percent of a core (load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores):")
    for name, parts in sorted(shares.items(), key=lambda item: -sum(item[1])):
        print(f"  {name.replace('_', '-'):<18} {sum(parts) / len(parts):5.1f} %")


if __name__ == "__main__":
    main()
