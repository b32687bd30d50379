"""What recording costs: rec-recorder's share of a processor with messages only, and with camera frames.

Messages come 1000 a second, beside ``cluon-OD4toStdout`` into a file, in turns. Frames are those of the recorded drive
on the Kiwi track, 640x480 at 10 Hz in I420; what an idle recorder takes is subtracted from the cost of one.
"""

import contextlib
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from bench_rec import drive
from players import ROOT, Measured, peer, service, tool

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Row, attempt, cost_row, plan, report
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import read_envelopes
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory
from dodo_dsl.opendlv.video import VideoDecoder

BUDGET = Budget.given()
CID, ROUNDS = 125, 5
SECONDS = 1.0 if BUDGET.limited else 4.0
NO_PEER = "pycluon is not installed: no peer to measure against"
MESSAGE_HZ, FRAME_HZ = 1000, 10
SIZE = "640x480"
FRAME_KINDS: tuple[tuple[float, str, tuple[str, ...]], ...] = (
    (0.75, "default quality", ()),
    (1.0, "lossless", ("--lossless",)),
)
"""The part of the budget by which each is done, its name, and flags of the recorder."""
FRAMES = ROOT / "tests_registry" / "recordings" / "kiwi-track.rec"
PEER = tool("cluon-OD4toStdout")


def ticks(rate: float) -> Iterator[int]:
    """Numbers at a rate, for SECONDS."""
    begin = time.perf_counter()
    for number in range(round(SECONDS * rate)):
        time.sleep(max(0.0, begin + number / rate - time.perf_counter()))
        yield number


def idle(measured: Measured) -> float:
    """Share of a processor while nothing happens."""
    time.sleep(0.5)
    before = measured.processor_time()
    time.sleep(SECONDS / 2)
    return (measured.processor_time() - before) / (SECONDS / 2)


def with_messages(measured: Measured, envelopes: list[Envelope]) -> float:
    """Share of a processor while messages come."""
    with Session(CID) as session:
        before = measured.processor_time()
        for number in ticks(MESSAGE_HZ):
            session.send_envelope(envelopes[number])
        time.sleep(0.1)
        return (measured.processor_time() - before) / SECONDS


def with_frames(measured: Measured, memory: SharedMemory, pictures: list[bytes]) -> float:
    before = measured.processor_time()
    for number in ticks(FRAME_HZ):
        show(memory, pictures[number % len(pictures)])
    time.sleep(0.1)
    return (measured.processor_time() - before) / SECONDS


def show(memory: SharedMemory, picture: bytes) -> None:
    with memory.lock():
        memory.buffer[: len(picture)] = picture
        memory.stamp(time.time_ns() // 1000)
    memory.notify_all()


def pictures() -> list[bytes]:
    messages, decoder = MessageSet.standard(), VideoDecoder("h264")
    images = (e for e in read_envelopes(FRAMES) if e.data_type == messages.id("opendlv.proxy.ImageReading"))
    frames = (decoder.decode(messages.decode(e.data_type, e.payload).data) for e in images)
    return [frame.pixels("i420").tobytes() for frame in frames if frame is not None]


def ours(path: Path) -> AbstractContextManager[Measured]:
    return service("rec_recorder", path.parent, f"--cid={CID}", f"--rec={path}")


@contextlib.contextmanager
def theirs(path: Path) -> Iterator[Measured]:
    assert PEER is not None
    with path.open("wb") as file, peer([PEER, f"--cid={CID}"], file) as measured:
        time.sleep(0.3)
        yield measured


def message_row(ours_us: Sequence[float], *rest: Any) -> Row:
    return cost_row("recorder, processor time of a message", "us", ours_us, *rest, note="" if PEER else NO_PEER)


def frame_row(kind: str, costs: Sequence[float]) -> Row:
    return cost_row(f"recorder, processor time of a frame, {kind}", "ms", costs)


def messages_only(folder: Path) -> None:
    envelopes = drive(round(SECONDS * MESSAGE_HZ))
    recorders = {"rec-recorder": ours, **({"cluon-OD4toStdout": theirs} if PEER else {})}
    found: dict[str, list[tuple[float, float, int]]] = {name: [] for name in recorders}
    for number in BUDGET.rounds(ROUNDS, until=0.5):
        for name, recorder in recorders.items():
            path = folder / f"{name}-{number}.rec"
            with recorder(path) as measured:
                shares = idle(measured), with_messages(measured, envelopes)
            found[name].append((*shares, len(list(read_envelopes(path)))))
    ours_us, *theirs_us = ([(busy - none) / MESSAGE_HZ * 1e6 for none, busy, _ in rounds] for rounds in found.values())
    rest = ("cluon-OD4toStdout", theirs_us[0]) if PEER else ()
    report(message_row(ours_us, *rest))
    print(f"messages only, {MESSAGE_HZ} a second:")
    for name, rounds in found.items():
        none, busy, count = (statistics.median(column) for column in zip(*rounds, strict=True))
        cost = (busy - none) / MESSAGE_HZ * 1e6
        recorded = f"{count} of {len(envelopes)} recorded"
        print(f"  {name:18} {busy:6.2%} of a processor ({none:.2%} idle), {cost:3.0f} us a message; {recorded}")


def frames_as_well(folder: Path, until: float, kind: str, *flags: str) -> None:
    shown = pictures()
    rounds = []
    for number in BUDGET.rounds(ROUNDS, until):
        name, path = f"bench-{os.getpid()}.i420", folder / f"{kind}-{number}.rec".replace(" ", "-")
        options = (f"--cid={CID}", f"--rec={path}", f"--frames={FRAME_HZ}", f"--memories={name}:{SIZE}", *flags)
        with SharedMemory.create(name, len(shown[0])) as memory, service("rec_recorder", folder, *options) as measured:
            none, busy = idle(measured), with_frames(measured, memory, shown)
        recorded = len(list(read_envelopes(path)))
        rounds.append((none, busy, recorded, path.stat().st_size / max(recorded, 1)))
    costs = [(busy - none) / FRAME_HZ * 1e3 for none, busy, *_ in rounds]
    report(frame_row(kind, costs))
    none, busy, count, size = (statistics.median(column) for column in zip(*rounds, strict=True))
    cost = (busy - none) / FRAME_HZ * 1e3
    print(
        f"  {kind:18} {busy:6.2%} of a processor ({none:.2%} idle), {cost:.1f} ms and {size / 1e3:.1f} kB a frame; "
        f"{count:.0f} of {SECONDS * FRAME_HZ:.0f} recorded"
    )


def main() -> int:
    plan(message_row([]), *(frame_row(kind, []) for _, kind, *_ in FRAME_KINDS))
    with tempfile.TemporaryDirectory() as name:
        with attempt(message_row([])):
            messages_only(Path(name))
        print(f"frames of {SIZE} at {FRAME_HZ} Hz:")
        for until, kind, flags in FRAME_KINDS:
            with attempt(frame_row(kind, [])):
                frames_as_well(Path(name), until, kind, *flags)
    if not PEER:
        print(NO_PEER)
    return 0


if __name__ == "__main__":
    sys.exit(main())
