"""A recording to CSV, cold start included, beside ``cluon-rec2csv``; and how fast recordings are written and read.

Peak memory is that of the process, beside the size of the file. The recording is one of a drive (poses, readings,
requests and detections in the mix of a simulation), made here.
"""

import random
import resource
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from players import ROOT, cost_of

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, attempt, cost_row, plan, rate_row, report
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.odvd import STANDARD
from dodo_dsl.opendlv.recording import Recording, read_envelopes
from dodo_dsl.opendlv.recording_writer import RecordingWriter

PEER = Path(sys.executable).with_name("cluon-rec2csv")
ENVELOPES, ROUNDS = 300_000, 9
WRITTEN, INDEXED = "recording written one by one", "recording indexed"
NO_PEER = "pycluon is not installed: no peer to measure against"
MIX = {
    "opendlv.sim.Frame": 4,
    "opendlv.sim.KinematicState": 4,
    "opendlv.proxy.DistanceReading": 4,
    "opendlv.proxy.GroundSteeringRequest": 2,
    "opendlv.proxy.PedalPositionRequest": 2,
    "opendlv.logic.perception.DetectionBoundingBox": 2,
    "opendlv.logic.perception.DetectionProperty": 2,
}


Run = tuple[float, float]
"""Seconds, and peak memory in MiB."""


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


def export(path: Path, folder: Path) -> Run:
    words = ["rec", "export", path, "--csv", "--messages=1.0", "-o", folder]
    return cost_of([sys.executable, "-m", "dodo_dsl", *words], ROOT)[:2]


def info(path: Path, _folder: Path) -> Run:
    return cost_of([sys.executable, "-m", "dodo_dsl", "rec", "info", path], ROOT)[:2]


def peer(path: Path, folder: Path) -> Run:
    folder.mkdir()
    return cost_of([PEER, f"--rec={path}", f"--odvd={STANDARD}"], folder)[:2]


WORKS = {"export": export, "info": info, "peer": peer}


def compare(path: Path, folder: Path) -> dict[str, list[Run]]:
    """Seconds and peak memory of each work, in turns."""
    found: dict[str, list[Run]] = {name: [] for name in WORKS if name != "peer" or PEER.is_file()}
    for number in Budget.given().rounds(ROUNDS):
        for name in found if number % 2 else reversed(found):
            shutil.rmtree(folder / name, ignore_errors=True)
            found[name].append(WORKS[name](path, folder / name))
        report(*rows(found, path.stat().st_size))
    return found


def rows(found: dict[str, list[Run]], size: int) -> list[Row]:
    """``size`` of the recording in bytes."""
    theirs = [run[0] for run in found.get("peer", [])]
    note = "" if theirs else NO_PEER
    rows = []
    for name, words in (("export", "rec export --csv"), ("info", "rec info")):
        each = [run[0] for run in found[name]], "cluon-rec2csv" if theirs else "", theirs
        rows.append(cost_row(f"{words}, from a cold start", "s", *each, goal=Goal(8), note=note))
        peaks = [run[1] * 2**20 / size for run in found[name]]
        rows.append(cost_row(f"{words}, peak memory", "x the file", peaks, goal=Goal(3, of="value")))
    return rows


def show(found: dict[str, list[Run]], folder: Path) -> None:
    for name, runs in found.items():
        took, memory = (statistics.median(column) for column in zip(*runs, strict=True))
        print(f"{name:7} {ENVELOPES / took:9,.0f} envelopes/s, cold start included; peak memory {memory:.0f} MiB")
    if "peer" in found:
        ratio = statistics.median(other[0] / own[0] for own, other in zip(found["export"], found["peer"], strict=True))
        same = contents(folder / "export") == contents(folder / "peer")
        print(f"the peer takes {ratio:.2f} times as long; the tables are {'equal' if same else 'NOT EQUAL'}")
    else:
        print(NO_PEER)


def streams(path: Path, envelopes: list[Envelope]) -> None:
    """Writes the recording, and shows how fast it is written and read in this process."""
    with RecordingWriter(path) as writer:
        one_by_one = seconds(lambda: [writer.write(envelope) for envelope in envelopes])  # type: ignore[func-returns-value]
    encoded = seconds(lambda: [encode_frame(envelope) for envelope in envelopes])
    read, indexed = seconds(lambda: list(read_envelopes(path))), seconds(lambda: Recording(path).close())
    print(f"written one by one:    {ENVELOPES / one_by_one:9,.0f} envelopes/s ({ENVELOPES / encoded:,.0f} encoded)")
    print(f"read as a stream:      {ENVELOPES / read:9,.0f} envelopes/s")
    print(f"indexed:               {ENVELOPES / indexed:9,.0f} envelopes/s")
    print(f"the recording has {path.stat().st_size / 1e6:.0f} MB", end="; ")
    print(f"peak memory here {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000:.0f} MB")
    report(rate_row(WRITTEN, "envelopes/s", [ENVELOPES / one_by_one]))
    report(rate_row(INDEXED, "envelopes/s", [ENVELOPES / indexed]))


def main() -> int:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "drive.rec"
        planned = rows({"export": [], "info": []}, 1)
        alone = [rate_row(what, "envelopes/s", []) for what in (WRITTEN, INDEXED)]
        plan(*planned, *alone)
        with attempt(*alone):
            streams(path, drive(ENVELOPES))
        with attempt(*planned):
            show(compare(path, folder), folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
