"""One who looks at everything sees each message of a lockstep test once, in the step that it belongs to."""

from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from dodo_dsl.opendlv import address_book
from dodo_dsl.opendlv.address import CHANNEL_VARIABLE
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.packets import Listener
from dodo_dsl.opendlv.session import Session
from services.base.clock_link import ClockClient
from services.base.lockstep_clock import EPOCH, Observer

STEP = 100_000
MESSAGES = MessageSet.standard()
MARK = MESSAGES.id("dodo.RecordedStep")


def sent(payload: bytes, time: int, received: int = 0) -> Envelope:
    return Envelope(1003, payload, 5, received, time, 0)


def on_bus(text: str, time: int = EPOCH) -> Envelope:
    """As it comes from the bus."""
    return sent(text.encode(), time, 9)


def step(number: int, *texts: str) -> tuple[int, list[Envelope]]:
    """A step, and what the clock hands on with it, of its time."""
    return number, [sent(text.encode(), EPOCH + number * STEP) for text in texts]


ANSWER = on_bus("answer")
OWN = on_bus("own", 77)
CASES: dict[str, tuple[list[Envelope | tuple[int, list[Envelope]]], list[tuple[str, int]]]] = {
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
    observer, seen = Observer(MESSAGES), list[Envelope]()
    for come in CASES[case][0]:
        if isinstance(come, Envelope):
            observer.collect(come)
        else:
            observer.deliver(seen.append, EPOCH + come[0] * STEP, come[1])
    assert [(e.payload.decode(), e.sample_time - EPOCH) for e in seen if e.data_type != MARK] == CASES[case][1]


def test_the_last_answer_is_seen_at_the_end_of_the_test() -> None:
    observer, seen = Observer(MESSAGES), list[Envelope]()
    observer.deliver(seen.append, EPOCH, step(0, "own")[1])
    observer.collect(ANSWER)
    for _ in range(2):
        observer.flush(seen.append)
    assert [each.payload for each in seen if each.data_type != MARK] == [b"own", b"answer"]


def test_what_services_send_is_not_taken_from_the_bus(
    cid: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It comes with the steps; what the runner sends for the application does not."""
    monkeypatch.setenv(CHANNEL_VARIABLE, str(tmp_path))
    with ExitStack() as stack:
        stack.enter_context(closing(Listener(tmp_path / ".clock", ("recorder",))))
        own, pose, application, runner = (stack.enter_context(Session(cid)) for _ in range(4))
        client = stack.enter_context(closing(ClockClient(own, "recorder")))
        for name, session in (("pose", pose), ("dodo-runner", runner)):
            address_book.enter(tmp_path, name, session.address)
        for payload, session in ((b"pose", pose), (b"application", application), (b"runner", runner)):
            session.send_envelope(sent(payload, EPOCH))
        seen: list[Envelope] = []
        assert client.drain(seen.append) and not client.drain(seen.append)
    assert [each.payload for each in seen] == [b"application", b"runner"]
