"""The clock of a lockstep test as its recording has it, in place of the link to it."""

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from google.protobuf.message import Message

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.recordings.recording import read_envelopes
from services.base.evaluator import UnjudgeableError
from services.base.lockstep.clock_client import Step
from services.base.lockstep.datagrams import decode
from services.base.recorded.step_marks import RECORDED_STEP, RECORDING_END


class RecordedStep(NamedTuple):
    """All messages that a step brought to the services of a test, in order, and its time in us."""

    time: int
    messages: list[Envelope]


class RecordedSteps:
    """Gives a LockstepClock one recorded step after the other; what the service sends goes nowhere.

    The service does not hear what it sent itself in the test, so messages that it sends again are left out.
    """

    def __init__(self, path: Path, messages: MessageSet) -> None:
        self._steps: Iterator[RecordedStep] = read_steps(path, messages)
        self._number = 0
        self._sent: Counter[Envelope] = Counter()
        self.is_over = False

    def next_step(self, observes: bool, observe: Callable[[Envelope], None]) -> Step | None:
        """The next step; None at the end of the recording."""
        step = next(self._steps, None)
        if step is None:
            self.is_over = True
            return None
        self._number += 1
        return Step(self._number, step.time, False, [each for each in step.messages if not self._is_own(each)])

    def answer(self, reply: list[Message], on_the_bus: bool = False) -> None:
        """The service has finished a step."""
        parts: list[Any] = list(reply)
        self._sent.update(_key(each.envelope) for each in decode(b"".join(part.frames for part in parts)))

    def repeat(self) -> None:
        """Nobody asks again."""

    def is_acknowledged(self) -> bool:
        """Nobody has to acknowledge."""
        return True

    def close(self) -> None:
        """Nothing is open."""

    def _is_own(self, envelope: Envelope) -> bool:
        key = _key(envelope)
        if not self._sent[key]:
            return False
        self._sent[key] -= 1
        return True


def read_steps(path: Path, messages: MessageSet) -> Iterator[RecordedStep]:
    """The steps of a recording; raises UnjudgeableError where some are missing, and OSError."""
    step_id, end_id = messages.id(RECORDED_STEP), messages.id(RECORDING_END)
    step, number = RecordedStep(0, []), 0
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
                step, number = RecordedStep(mark.time, []), mark.number
            step.messages.extend(each.envelope for each in decode(mark.frames))
        elif number and envelope.data_type != end_id:
            step.messages.append(envelope)
    if number:
        yield step


def _key(envelope: Envelope) -> Envelope:
    """The same for a message of the test and the same one of now."""
    return envelope._replace(sent=0, received=0)
