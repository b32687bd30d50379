"""How the steps of a test in lockstep are marked in its recording.

The messages of the test's services are in it as they were sent, ``received`` at 0, behind the ``dodo.RecordedStep`` in
which services got it. That holds the application's messages as the clock passed them on: with the sample time of the
frame, and without surplus answers. They are also in the recording as they were on the bus, which does not count here.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

from dodo_dsl.opendlv.bus.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.messages.message_set import MessageSet
from services.base.lockstep.observer import EPOCH

RECORDED_STEP, RECORDING_END = "dodo.RecordedStep", "dodo.RecordingEnd"


class StepMarks:
    """Makes the envelopes that mark steps in a recording; their sample time is that of the step before."""

    def __init__(self, messages: MessageSet) -> None:
        self._messages, self._type, self._id = messages, messages.type(RECORDED_STEP), messages.id(RECORDED_STEP)
        self._number = 0
        self._last = EPOCH

    def of(self, time: int, relayed: Sequence[Envelope]) -> Iterator[Envelope]:
        """What a recording holds of a step at ``time`` (us) that brought ``relayed``; one mark at least."""
        self._number += 1
        if not relayed or not relayed[0].received:
            yield self._mark(time, ())
        for is_own, group in groupby(relayed, key=lambda envelope: not envelope.received):
            messages = list(group)
            yield from messages if is_own else (self._mark(time, messages),)
        self._last = max(time, EPOCH)

    def _mark(self, time: int, others: Iterable[Envelope]) -> Envelope:
        message = self._type(number=self._number, time=time, frames=b"".join(map(encode_frame, others)))
        return Envelope(self._id, self._messages.encode(message), self._last, 0, self._last, 0)
