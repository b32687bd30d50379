"""One who looks at everything sees each message of a lockstep test once, in the step that it belongs to."""

import pytest

from dodo_dsl.opendlv.envelope import Envelope
from services.base.lockstep_clock import EPOCH, Observer

STEP = 100_000


class Seen:
    """An inbox that remembers."""

    observes = True
    consumes: frozenset[int] = frozenset()

    def __init__(self) -> None:
        self.seen: list[tuple[bytes, int]] = []

    def observe(self, envelope: Envelope) -> None:
        self.seen.append((envelope.payload, envelope.sample_time))

    def handle(self, envelope: Envelope) -> None:
        raise AssertionError

    def receive(self, timeout: float) -> Envelope | None:
        raise AssertionError


def sent(payload: bytes, time: int, received: int = 0) -> Envelope:
    return Envelope(1003, payload, 5, received, time, 0)


def on_bus(text: str, time: int = EPOCH) -> Envelope:
    """As it comes from the bus."""
    return sent(text.encode(), time, 9)


def step(number: int, *texts: str) -> tuple[int, list[Envelope]]:
    """A step, and what the clock hands on with it, of its time."""
    return number, [sent(text.encode(), EPOCH + number * STEP) for text in texts]


A, B, ANSWER = on_bus("a"), on_bus("b"), on_bus("answer")
OWN = on_bus("own", 77)
CASES: dict[str, tuple[list[Envelope | tuple[int, list[Envelope]]], list[tuple[str, int]]]] = {
    "copies on the bus count once, however late": ([A, step(0, "a", "b"), B, step(1)], [("a", 0), ("b", 0)]),
    "what was lost on the bus is seen": ([step(0, "a")], [("a", 0)]),
    "the application's is seen as it is on the bus": (
        [OWN, (0, [OWN._replace(sample_time=EPOCH)])],
        [("own", 77 - EPOCH)],
    ),
    "a later step's message waits for that": ([on_bus("early", EPOCH + STEP), step(0), step(1)], []),
    "and comes after it": ([on_bus("early", EPOCH + STEP), step(0), step(1), step(2)], [("early", STEP)]),
    "an answer stands before the next step": (
        [ANSWER, step(0, "0"), step(1, "1")],
        [("0", 0), ("answer", 0), ("1", STEP)],
    ),
    "whenever it came": ([step(0, "0"), ANSWER, step(1, "1")], [("0", 0), ("answer", 0), ("1", STEP)]),
}
"""What comes from the bus and the clock, and what is seen when."""


@pytest.mark.parametrize("case", CASES)
def test_each_message_is_seen_once_in_its_step(case: str) -> None:
    observer, inbox = Observer(), Seen()
    for come in CASES[case][0]:
        if isinstance(come, Envelope):
            observer.collect(come)
        else:
            observer.deliver(inbox, EPOCH + come[0] * STEP, come[1])
    assert [(payload.decode(), time - EPOCH) for payload, time in inbox.seen] == CASES[case][1]


def test_the_last_answer_is_seen_at_the_end_of_the_test() -> None:
    observer, inbox = Observer(), Seen()
    observer.deliver(inbox, *(EPOCH, step(0, "own")[1]))
    for come in (on_bus("own"), ANSWER):
        observer.collect(come)
    observer.flush(inbox)
    observer.flush(inbox)
    assert [payload for payload, _ in inbox.seen] == [b"own", b"answer"]


def test_what_services_sent_long_ago_is_forgotten() -> None:
    """A hundred steps later a copy counts, unless a service sent the same again meanwhile; none is that late."""
    observer, inbox = Observer(), Seen()
    for step in range(1, 103):
        again = [sent(b"again", 88)] if step in (1, 90) else []
        observer.deliver(inbox, EPOCH + step * STEP, [sent(b"once", 77), *again] if step == 1 else again)
    inbox.seen.clear()
    for payload, time in ((b"once", 77), (b"again", 88)):
        observer.collect(sent(payload, time, 9))
    observer.deliver(inbox, EPOCH + 103 * STEP, [])
    assert inbox.seen == [(b"once", 77)]
