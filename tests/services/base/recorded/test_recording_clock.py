"""In real time messages come when they were received, and updates at their period in between."""

from pathlib import Path

from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from services.base.recorded_clock import RecordingClock
from tests.services.base.lockstep.test_observer import Seen

MESSAGES = MessageSet.standard()
START = 1_750_000_000_000_000


class Inbox(Seen):
    """What a service gets and when: a letter for a message, a number for an update, us from the start."""

    observes = False

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
