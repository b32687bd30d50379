"""A recording to CSV, cold start included, beside ``cluon-rec2csv``; and how fast recordings are written and read.

The recording is one of a drive (poses, readings, requests and detections in the mix of a simulation), made here.
"""

import random
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from dodo_dsl.opendlv.bus.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.odvd import STANDARD
from dodo_dsl.opendlv.recordings.recording import Recording, read_envelopes
from dodo_dsl.opendlv.recordings.writer import RecordingWriter

ROOT = Path(__file__).parents[1]
PEER = Path(sys.executable).with_name("cluon-rec2csv")
ENVELOPES, ROUNDS = 300_000, 5
MIX = {
    "opendlv.sim.Frame": 4,
    "opendlv.sim.KinematicState": 4,
    "opendlv.proxy.DistanceReading": 4,
    "opendlv.proxy.GroundSteeringRequest": 2,
    "opendlv.proxy.PedalPositionRequest": 2,
    "opendlv.logic.perception.DetectionBoundingBox": 2,
    "opendlv.logic.perception.DetectionProperty": 2,
}


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def some_value(rng: random.Random, type_: str) -> object:
    if type_ == "float":
        return rng.choice((0.0, rng.uniform(-5, 5)))
    return rng.choice(("yellow", "blue")) if type_ == "string" else rng.randrange(1000)


def drive(count: int) -> list[Envelope]:
    rng, messages = random.Random(5), MessageSet.standard()
    names = rng.choices(list(MIX), list(MIX.values()), k=count)
    envelopes = []
    for number, name in enumerate(names):
        fields = messages.layout(name).definition.fields
        payload = messages.encode(messages.type(name)(**{f.name: some_value(rng, f.type) for f in fields}))
        now = 1_700_000_000_000_000 + 2_000 * number
        stamp = rng.randrange(4) if name.endswith("DistanceReading") else 0
        envelopes.append(Envelope(messages.id(name), payload, now, now + 90, now - rng.randrange(9_000), stamp))
    return envelopes


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.csv")}


def export(path: Path, folder: Path) -> None:
    command = [sys.executable, "-m", "dodo_dsl", "rec", "export", path, "--csv", "--messages=1.0", "-o", folder]
    subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)


def peer(path: Path, folder: Path) -> None:
    folder.mkdir()
    subprocess.run([PEER, f"--rec={path}", f"--odvd={STANDARD}"], cwd=folder, check=True, capture_output=True)


def compare(path: Path, folder: Path) -> None:
    ours, theirs = [], []
    for _ in range(ROUNDS):
        for target, work, times in ((folder / "ours", export, ours), (folder / "theirs", peer, theirs)):
            shutil.rmtree(target, ignore_errors=True)
            times.append(seconds(lambda work=work, target=target: work(path, target)))
    same = contents(folder / "ours") == contents(folder / "theirs")
    own, others = statistics.median(ours), statistics.median(theirs)
    print(f"dodo rec export --csv: {ENVELOPES / own:9,.0f} envelopes/s, cold start included")
    print(f"cluon-rec2csv:         {ENVELOPES / others:9,.0f} envelopes/s")
    print(f"the peer takes {others / own:.2f} times as long; the tables are {'equal' if same else 'NOT EQUAL'}")


def main() -> int:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "drive.rec"
        envelopes = drive(ENVELOPES)
        with RecordingWriter(path) as writer:
            one_by_one = seconds(lambda: [writer.write(envelope) for envelope in envelopes])
        encoded = seconds(lambda: [encode_frame(envelope) for envelope in envelopes])
        size = path.stat().st_size / 1e6
        print(f"written one by one:    {ENVELOPES / one_by_one:9,.0f} envelopes/s ({ENVELOPES / encoded:,.0f} encoded)")
        print(f"read as a stream:      {ENVELOPES / seconds(lambda: list(read_envelopes(path))):9,.0f} envelopes/s")
        print(f"indexed:               {ENVELOPES / seconds(lambda: Recording(path).close()):9,.0f} envelopes/s")
        print(f"the recording has {size:.0f} MB", end="; ")
        print(f"peak memory here {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000:.0f} MB")
        if PEER.is_file():
            compare(path, folder)
        else:
            print("pycluon is not installed: no peer to measure against")
    return 0


if __name__ == "__main__":
    sys.exit(main())
