"""rec-replay beside ``cluon-replay``: messages a second, how evenly they come in real time, and the processor's share.

The times are those at which the kernel took the datagrams, so that what listens here does not count. As fast as
possible is a recording whose messages are all of one time. In real time, which lasts 6 s and for the ledger 2 s, a
message's deviation is how much earlier or later it came than its sample time says; a player that is evenly too slow or
too fast shows in the duration instead.
"""

import statistics
import sys
import tempfile
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from bench_rec import drive
from players import Measured, peer, service, tool

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, attempt, cost_row, plan, rate_row, report
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.recording_writer import RecordingWriter
from dodo_dsl.opendlv.session import Session

FAST, EVEN, SHORT, ROUNDS = 50_000, 3_000, 1_000, 5  # messages; those in real time are 2 ms apart
CID = 126
STATUS, END = 10, 2901
QUIET = 3.0
GATHERS = 0.005
"""Seconds for which what listens sleeps at a time: were it woken by each message, it would hold up the player."""
PEER = tool("cluon-replay")
NO_PEER = "pycluon is not installed: no peer to measure against"


class Heard(NamedTuple):
    """What came: when (us), when it was sampled (us), how many were lost, and the player's processor time (s)."""

    received: "np.ndarray[tuple[int], np.dtype[np.int64]]"
    sampled: "np.ndarray[tuple[int], np.dtype[np.int64]]"
    lost: int
    processor: float

    def rate(self) -> float:
        """Messages a second, lost ones included: the player sent these."""
        return (len(self.received) + self.lost) / (self.received[-1] - self.received[0]) * 1e6

    def cost(self) -> float:
        """Microseconds of processors for a message."""
        return self.processor / (len(self.received) + self.lost) * 1e6

    def deviations(self) -> list[float]:
        """Percentiles 50, 90, 99 and 100 in ms."""
        times = (self.sampled - self.sampled[0]) / 1e6
        late = (self.received - self.sampled - (self.received[0] - self.sampled[0])) / 1000.0
        line = np.polyval(np.polyfit(times, late, 1), times)
        found: list[float] = np.percentile(np.abs(late - line), (50, 90, 99, 100)).tolist()
        return found


def ours(path: Path) -> AbstractContextManager[Measured]:
    flags = (f"--cid={CID}", f"--rec={path}", "--await-begin=true", "--max-gap=60")
    return service("rec_replay", path.parent, *flags)


def theirs(path: Path) -> AbstractContextManager[Measured]:
    assert PEER is not None
    return peer([PEER, f"--cid={CID}", path])


def listen(path: Path, name: str, count: int) -> Heard:
    """One play of the recording."""
    received, sampled = [], []
    with Session(CID) as session, (ours if name == "rec-replay" else theirs)(path) as player:
        session.gather(GATHERS)
        if name == "rec-replay":
            session.send(session.messages.type("dodo.TestBegin")())
        begin = processor = 0.0
        while len(received) + session.lost < count and (envelope := session.receive(QUIET)) is not None:
            if envelope.data_type in (STATUS, END):
                continue
            received.append(envelope.received)
            sampled.append(envelope.sample_time)
            if len(received) == 1:
                begin = player.processor_time()
            elif len(received) % (count // 10) == 0:
                processor = player.processor_time() - begin
        return Heard(np.array(received), np.array(sampled), session.lost, processor)


def write(path: Path, envelopes: list[Envelope]) -> Path:
    with RecordingWriter(path) as writer:
        for envelope in envelopes:
            writer.write(envelope)
    return path


def in_turns(path: Path, count: int, budget: Budget, until: float) -> dict[str, list[Heard]]:
    names = ["rec-replay", "cluon-replay"] if PEER else ["rec-replay"]
    found: dict[str, list[Heard]] = {name: [] for name in names}
    for number in budget.rounds(ROUNDS, until):
        for name in names if number % 2 else reversed(names):
            found[name].append(listen(path, name, count))
    return found


def columns(found: dict[str, list[Heard]], value: Callable[[Heard], float]) -> dict[str, Any]:
    """Values of both, as a row takes them."""
    ours, *theirs = ([value(heard) for heard in rounds] for rounds in found.values())
    return {"ours": ours, "peer": "cluon-replay", "theirs": theirs[0]} if theirs else {"ours": ours, "note": NO_PEER}


def fast_row(found: dict[str, list[Heard]]) -> Row:
    return rate_row("replay, all due at once", "messages/s", **columns(found, Heard.rate), goal=Goal(1))


def fast_cost_row(found: dict[str, list[Heard]]) -> Row:
    """However busy the machine is, and whatever its scheduler gives to several threads of one player."""
    return cost_row("replay, processor time of a message due at once", "us", **columns(found, Heard.cost))


def even_row(found: dict[str, list[Heard]]) -> Row:
    """The 90th percentile: single late ones say more of the machine than of the player."""
    return cost_row("replay in real time, 90 % within", "ms", **columns(found, lambda heard: heard.deviations()[1]))


def show_fast(found: dict[str, list[Heard]]) -> None:
    print("as fast as possible:")
    for name, rounds in found.items():
        rate, lost = statistics.median(h.rate() for h in rounds), sum(h.lost for h in rounds)
        print(f"  {name:13} {rate:9,.0f} messages/s ({lost} of {len(rounds) * FAST} overran the listener's buffer)")
    for text, row in (("as many", fast_row(found)), ("as little of a processor", fast_cost_row(found))):
        if ratios := row.ratios:
            print(f"  {statistics.median(ratios):.2f} times {text} ({min(ratios):.2f} to {max(ratios):.2f})")


def show_even(found: dict[str, list[Heard]]) -> None:
    print("in real time, 500 messages/s; deviation in ms of 50 %, 90 %, 99 % and all, and error of the duration:")
    for name, rounds in found.items():
        middle = [statistics.median(column) for column in zip(*(h.deviations() for h in rounds), strict=True)]
        drift = statistics.median((np.ptp(h.received) - np.ptp(h.sampled)) / 1000.0 for h in rounds)
        share = statistics.median(h.processor / np.ptp(h.received) * 1e6 for h in rounds)
        numbers = "  ".join(f"{value:6.2f}" for value in middle)
        print(f"  {name:13} {numbers}   {drift:+7.1f} ms   {share:.1%} of a processor")


def main() -> int:
    with tempfile.TemporaryDirectory() as name:
        envelopes = drive(FAST)
        at_once = [e._replace(sample_time=1_700_000_000_000_000) for e in envelopes]
        budget = Budget.given()
        at_once_rows = fast_row({"": []}), fast_cost_row({"": []})
        plan(*at_once_rows, even_row({"": []}))
        count = SHORT if budget.limited else EVEN
        even = [e._replace(sample_time=e.sent) for e in envelopes[:count]]
        with attempt(*at_once_rows):
            fast = in_turns(write(Path(name) / "fast.rec", at_once), FAST, budget, until=0.4)
            report(fast_row(fast), fast_cost_row(fast))
            show_fast(fast)
        with attempt(even_row({"": []})):
            found = in_turns(write(Path(name) / "even.rec", even), count, budget, until=1.0)
            report(even_row(found))
            show_even(found)
    if not PEER:
        print(NO_PEER)
    return 0


if __name__ == "__main__":
    sys.exit(main())
