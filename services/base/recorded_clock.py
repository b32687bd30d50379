"""The clock for a recording: its steps where it has them, else its messages by when they were received."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dodo_dsl.opendlv.address import HEADER_BYTES, body_length
from dodo_dsl.opendlv.channel import Done, Step
from dodo_dsl.opendlv.envelope import Envelope, decode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import read_envelopes
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError
from services.base.clock import Clock
from services.base.clock_link import ClockClient
from services.base.evaluator import UnjudgeableError
from services.base.lockstep_clock import RECORDED_STEP, RECORDING_END, LockstepClock

if TYPE_CHECKING:
    from services.base.loop import Loop


class RecordedSteps(ClockClient):
    """Gives a LockstepClock recorded steps, without what the service sent itself and so did not hear."""

    def __init__(self, path: Path, messages: MessageSet) -> None:
        self._steps = read_steps(path, messages)
        self._sent: Counter[Envelope] = Counter()

    def next(self, observe: Callable[[Envelope], None] | None) -> Step:
        """Raises EOFError behind the last one."""
        if (step := next(self._steps, None)) is None:
            raise EOFError
        return Step(step.time, [each for each in step.messages if not self._is_own(each)])

    def drain(self, observe: Callable[[Envelope], None]) -> bool:
        return False

    def answer(self, done: Done) -> None:
        self._sent.update(each._replace(sent=0, received=0) for each in done.messages)

    def _is_own(self, envelope: Envelope) -> bool:
        key = envelope._replace(sent=0, received=0)
        if not self._sent[key]:
            return False
        self._sent[key] -= 1
        return True

    def close(self) -> None:
        """Nothing is open."""


def read_steps(path: Path, messages: MessageSet) -> Iterator[Step]:
    """The steps of a recording, with all that each brought; raises UnjudgeableError if some lack, and OSError."""
    step_id, end_id = messages.id(RECORDED_STEP), messages.id(RECORDING_END)
    step, number = Step(0, []), 0
    for envelope in read_envelopes(path):
        if envelope.received:
            continue  # as it was on the bus, where anyone can send marks
        if envelope.data_type == step_id:
            mark: Any = messages.decode(step_id, envelope.payload)
            if mark.number != number:
                if number:
                    yield step
                if mark.number != number + 1:
                    lacks = f"lacks the steps {number + 1} to {mark.number - 1}"
                    raise UnjudgeableError(
                        f"the recording {lacks}: it was paused, reached its largest size, or is damaged"
                    )
                step, number = Step(mark.time, []), mark.number
            step.messages.extend(_decoded(mark.frames))
        elif number and envelope.data_type != end_id:
            step.messages.append(envelope)
    if number:
        yield step


def _decoded(frames: bytes) -> Iterator[Envelope]:
    """The envelopes of frames that follow one another; raises FrameError."""
    while frames:
        yield decode_frame(frames)
        frames = frames[HEADER_BYTES + body_length(frames) :]


class RecordingClock(Clock):
    """Test time goes from message to message of a recording; nothing waits. Raises OSError.

    Instants begin with the first message, not with the start of the service, which is in no recording. They end where
    recording ended.
    """

    def __init__(self, path: Path, messages: MessageSet) -> None:
        self._path, self._end_id = path, messages.id(RECORDING_END)
        self._now = 0

    def now(self) -> int:
        return self._now

    def steps(self, period: Fraction | int, inbox: "Loop", stopped: Callable[[], bool]) -> Iterator[int]:
        number, due, start = 0, 0, 0
        for envelope in self._arrivals():
            start = start or envelope.received
            while (due := start + round(number * period)) < envelope.received:
                if stopped():
                    return
                self._now = due
                yield due
                number += 1
            self._now = max(self._now, envelope.received)
            if envelope.data_type != self._end_id:
                inbox.handle(envelope)
            if stopped():
                return

    def memory(self, name: str, size: int) -> SharedMemory:
        raise SharedMemoryError(f"a recording has no shared memory '{name}'")

    def _arrivals(self) -> Iterator[Envelope]:
        """All messages, the end of the recording as one that was received then."""
        for envelope in read_envelopes(self._path):
            if envelope.received:
                yield envelope
            elif envelope.data_type == self._end_id:
                yield envelope._replace(received=envelope.sample_time)
                return


def clock_of(recording: Path, session: Session, role: str) -> Clock:
    """The clock for the service ``role``; raises OSError for a file that cannot be read."""
    if next(read_steps(recording, session.messages), None) is None:
        return RecordingClock(recording, session.messages)
    return LockstepClock(session, role, 1, RecordedSteps(recording, session.messages))


class SilentSession(Session):
    """Nobody hears what is sent, and nothing is received. It opens no socket."""

    def __init__(self, cid: int, messages: MessageSet) -> None:
        self.cid, self.messages = cid, messages
        self.garbage = self.lost = 0
        self.was_direct = False
        self.address = self.source = ("", 0)

    def send_frames(self, frames: Iterable[bytes]) -> None:
        """Nobody hears it."""

    def hear_directly(self, hears: bool = True) -> None:
        """There is nothing to hear."""

    def receive(self, timeout: float | None = 0.0) -> Envelope | None:
        return None
