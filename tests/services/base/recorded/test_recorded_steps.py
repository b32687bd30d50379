"""A recording gives services the same messages in the same steps as the clock did; in real time when they came."""

from collections.abc import Iterable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.channel import Done, Step
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from services.base.evaluator import UnjudgeableError
from services.base.lockstep_clock import EPOCH, Observer
from services.base.recorded_clock import RecordedSteps, RecordingClock, read_steps

STEP = 100_000
MESSAGES = MessageSet.standard()
END = Envelope(MESSAGES.id("dodo.RecordingEnd"), b"", 9, 0, EPOCH, 0)
FORGED = Envelope(MESSAGES.id("dodo.RecordedStep"), b"", 9, 9, EPOCH, 0)


def sent(name: str, received: int = 0) -> Envelope:
    return Envelope(1003, name.encode(), 5, received, EPOCH, 0)


def write(path: Path, envelopes: Iterable[Envelope]) -> Path:
    path.write_bytes(b"".join(map(encode_frame, envelopes)))
    return path


names = st.text("abc", max_size=2)
relayed = st.lists(st.builds(sent, names, st.sampled_from((0, 0, 7))), max_size=5)
raw = st.lists(st.builds(sent, names, st.integers(8, 9)), max_size=3)


@given(st.lists(st.tuples(relayed, raw), min_size=1, max_size=5))
@pytest.mark.thorough
def test_steps_are_those_of_the_clock_whatever_was_on_the_bus(
    tmp_path_factory: pytest.TempPathFactory, steps: list[tuple[list[Envelope], list[Envelope]]]
) -> None:
    observer, seen = Observer(MESSAGES), list[Envelope]()
    for number, (messages, on_the_bus) in enumerate(steps):
        for envelope in on_the_bus:
            observer.collect(envelope)
        observer.deliver(seen.append, EPOCH + number * STEP, messages)
    observer.flush(seen.append)
    path = write(tmp_path_factory.mktemp("steps") / "test.rec", [*seen, FORGED, END])
    assert [(step.time, step.messages) for step in read_steps(path, MESSAGES)] == [
        (EPOCH + number * STEP, messages) for number, (messages, _) in enumerate(steps)
    ]


def test_a_recording_with_a_hole_is_refused(tmp_path: Path) -> None:
    observer, seen = Observer(MESSAGES), list[Envelope]()
    for number in range(5):
        observer.deliver(seen.append, EPOCH + number * STEP, [sent(str(number))])
    path = write(tmp_path / "test.rec", [*seen[:2], *seen[8:]])
    with pytest.raises(UnjudgeableError, match="lacks the steps 2 to 4: it was paused"):
        list(read_steps(path, MESSAGES))


def test_a_service_does_not_hear_itself(tmp_path: Path) -> None:
    observer, seen, own = Observer(MESSAGES), list[Envelope](), sent("own")
    observer.deliver(seen.append, EPOCH, [sent("a")])
    observer.deliver(seen.append, EPOCH + STEP, [own, sent("b"), own])
    source = RecordedSteps(write(tmp_path / "test.rec", seen), MESSAGES)
    assert source.next(None) == Step(EPOCH, [sent("a")])
    source.answer(Done("judge", [own._replace(sent=77)]))
    assert source.next(None) == Step(EPOCH + STEP, [sent("b"), own])
    with pytest.raises(EOFError):
        source.next(None)


START = 1_750_000_000_000_000


class Inbox:
    """What a service gets and when: a letter for a message, a number for an update, us from the start."""

    def __init__(self, clock: RecordingClock) -> None:
        self.clock = clock
        self.story: list[tuple[str, int]] = []

    def handle(self, envelope: Envelope) -> None:
        self.story.append((envelope.payload.decode(), self.clock.now() - START))


def recording(path: Path, *arrivals: tuple[str, int], end: int) -> Path:
    envelopes = [Envelope(1003, text.encode(), 1, START + time, 2, 0) for text, time in arrivals]
    envelopes.append(Envelope(MESSAGES.id("dodo.RecordingEnd"), b"", START, 0, START + end, 0))
    path.write_bytes(b"".join(map(encode_frame, envelopes)))
    return path


def test_updates_go_on_until_recording_ended(tmp_path: Path) -> None:
    clock = RecordingClock(recording(tmp_path / "a.rec", ("a", 0), ("b", 10), ("c", 15), end=36), MESSAGES)
    inbox = Inbox(clock)
    for now in clock.steps(10, inbox, lambda: False):
        assert now == clock.now()
        inbox.story.append(("", now - START))
    assert inbox.story == [("a", 0), ("", 0), ("b", 10), ("", 10), ("c", 15), ("", 20), ("", 30)]


def test_it_ends_as_soon_as_the_service_does(tmp_path: Path) -> None:
    clock = RecordingClock(recording(tmp_path / "a.rec", ("a", 0), ("b", 10), ("c", 15), end=36), MESSAGES)
    inbox = Inbox(clock)
    updates = list(clock.steps(100, inbox, lambda: len(inbox.story) == 2))
    assert ([text for text, _ in inbox.story], updates) == (["a", "b"], [START])
