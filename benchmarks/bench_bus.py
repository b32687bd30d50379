"""Messages sent and received per second through our Session, beside pycluon (libcluon in C++).

Two processes talk: one makes, sends and counts on answers; the other receives, decodes and answers each BURST-th
message, so that at most WINDOW messages are under way and none is lost. Both peers do the same work: a message object
is made, serialised, sent with its times, received, and made an object again. Where other work shares the processors,
the messages a second depend on how much of it there is; processor time, of both processes and all threads, does not.
"""

import datetime
import importlib.util
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, cost_row, plan, rate_row, report
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session

COUNT, BURST, WINDOW, ROUNDS = 10_000, 100, 300, 15
CID = 127
MESSAGE, ANSWER = "opendlv.sim.Frame", "opendlv.proxy.PedalPositionRequest"
POSE = {"y": 1.5, "z": 0.1, "qx": 0.1, "qy": 0.2, "qz": 0.3, "qw": 0.9}  # no field is left out
PATIENCE = 10.0
ORDERS = ("receive", "send")
Round = tuple[float, float, float]


class Ours:
    """A member of the bus that takes messages and has a count of answers."""

    def __init__(self) -> None:
        self._session = Session(CID)
        self._frame = self._session.messages.type(MESSAGE)
        self._answer = self._session.messages.type(ANSWER)
        self._id = self._session.messages.id(MESSAGE)

    def send(self, number: int) -> None:
        self._session.send(self._frame(x=number, **POSE), sender_stamp=1)

    def wait_for_answer(self) -> None:
        if self._session.receive(PATIENCE) is None:
            raise TimeoutError

    def receive(self, count: int) -> None:
        session, messages = self._session, self._session.messages
        for number in range(1, count + 1):
            envelope = session.receive(PATIENCE)
            if envelope is None:
                raise TimeoutError
            take(messages.decode(envelope.data_type, envelope.payload), number)
            if number % BURST == 0:
                session.send(self._answer())


class Theirs:
    """The same with pycluon, whose messages come in a thread of libcluon."""

    def __init__(self) -> None:
        import pycluon

        messages = MessageSet.standard()
        self._envelope = pycluon.Envelope
        self._frame, self._id = messages.type(MESSAGE), messages.id(MESSAGE)
        self._answer, self._answer_id = messages.type(ANSWER)(), messages.id(ANSWER)
        self._answers, self._done = threading.Semaphore(0), threading.Event()
        self._number, self._count = 0, 0
        self._session = pycluon.OD4Session(CID)
        self._session.add_data_trigger(self._id, self._take)
        self._session.add_data_trigger(self._answer_id, lambda _envelope: self._answers.release())

    def send(self, number: int) -> None:
        self._send(self._id, self._frame(x=number, **POSE), 1)

    def wait_for_answer(self) -> None:
        if not self._answers.acquire(timeout=PATIENCE):
            raise TimeoutError

    def receive(self, count: int) -> None:
        self._count = count
        if not self._done.wait(PATIENCE * 3):
            raise TimeoutError

    def _send(self, id_: int, message: Any, stamp: int) -> None:
        envelope = self._envelope()
        envelope.data_type, envelope.sender_stamp = id_, stamp
        envelope.serialized_data = message.SerializeToString()
        envelope.sent_at = envelope.sampled_at = datetime.datetime.now()
        self._session.send(envelope)

    def _take(self, envelope: Any) -> None:
        self._number += 1
        take(self._frame.FromString(envelope.serialized_data), self._number)
        if self._number % BURST == 0:
            self._send(self._answer_id, self._answer, 0)
        if self._number == self._count:
            self._done.set()


PEERS: dict[str, Callable[[], Ours | Theirs]] = {"ours": Ours, "pycluon": Theirs}


def take(frame: Any, number: int) -> None:
    if frame.x != number:
        raise RuntimeError(f"message {number} is missing: {frame.x} came")


def send(peer: Ours | Theirs) -> None:
    for number in range(1, COUNT + 1):
        peer.send(number)
        if number % BURST == 0 and number >= WINDOW:
            peer.wait_for_answer()
    for _ in range(WINDOW // BURST - 1):
        peer.wait_for_answer()


def member(role: str, name: str) -> int:
    """In its own process: seconds from the first message to the last answer, and processor time."""
    peer = PEERS[name]()
    print("ready", flush=True)
    sys.stdin.readline()
    start, processor = time.perf_counter(), time.process_time()
    if role == "send":
        send(peer)
    else:
        peer.receive(COUNT)
    print(time.perf_counter() - start, time.process_time() - processor, flush=True)
    return 0


def start(role: str, name: str) -> "subprocess.Popen[str]":
    command = [sys.executable, __file__, role, name]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    if process.stdout.readline() != "ready\n":
        raise RuntimeError(f"{name} cannot {role}")
    return process


def round_of(name: str) -> Round:
    """Messages a second, and microseconds of processor time that a message takes to send and to receive."""
    processes = [start(role, name) for role in ORDERS]
    try:
        for process in processes:
            assert process.stdin is not None
            process.stdin.write("go\n")
            process.stdin.flush()
            time.sleep(0.1)  # the receiver first
        answers = [process.communicate(timeout=60)[0].split() for process in processes]
    finally:
        for process in processes:
            process.kill()
            process.wait()
    (_, receiving), (seconds, sending) = ([float(word) for word in answer] for answer in answers)
    return COUNT / seconds, sending / COUNT * 1e6, receiving / COUNT * 1e6


def show(name: str, rounds: list[Round]) -> None:
    rate, sending, receiving = (statistics.median(column) for column in zip(*rounds, strict=True))
    print(f"{name:9} {rate:7,.0f} messages/s; processor time of a message: {sending:.0f} us + {receiving:.0f} us")


def compare(text: str, ratios: Sequence[float]) -> None:
    print(f"{text}{statistics.median(ratios):.2f} times ({min(ratios):.2f} to {max(ratios):.2f}, {len(ratios)} rounds)")


def rows(ours: list[Round], theirs: list[Round], note: str) -> tuple[Row, Row]:
    """Messages a second, and the processor time of a message."""
    name, goal = "pycluon" if theirs else "", Goal(2, quartile=1.5)
    columns = [found[0] for found in ours], name, [found[0] for found in theirs]
    many = rate_row("bus: messages sent and received", "messages/s", *columns, goal=goal, note=note)
    times = [found[1] + found[2] for found in ours], name, [found[1] + found[2] for found in theirs]
    return many, cost_row("bus: processor time of a message", "us", *times, note=note)


def main() -> int:
    if len(sys.argv) > 2:
        return member(sys.argv[1], sys.argv[2])
    ours: list[Round] = []
    theirs: list[Round] = []
    note, budget = "", Budget.given()
    plan(*rows([], [], ""))
    if importlib.util.find_spec("pycluon") is None:
        note = "pycluon is not installed: no peer to measure against"
        print(note)
    for number in budget.rounds(ROUNDS):
        turns = (("ours", ours), *(() if note else (("pycluon", theirs),)))
        for name, rounds in turns if number % 2 else reversed(turns):
            rounds.append(round_of(name))
        report(*rows(ours, theirs, note))
    show("Session:", ours)
    if theirs:
        show("pycluon:", theirs)
        many, times = rows(ours, theirs, note)
        compare("as many a second: ", many.ratios)
        compare("as many a second of processor time: ", times.ratios)
    return 0


if __name__ == "__main__":
    sys.exit(main())
