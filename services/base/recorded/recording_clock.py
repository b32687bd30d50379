"""The clock of a test in real time as its recording has it: messages come when they were received."""

from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.memory.shared_memory import SharedMemory, SharedMemoryError
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.recordings.recording import read_envelopes
from services.base.clock import Inbox
from services.base.recorded.step_marks import RECORDING_END


class RecordingClock:
    """Test time goes from message to message of a recording; nothing waits. Raises OSError.

    Instants begin with the first message, not with the start of the service, which no recording tells. They end where
    recording ended.
    """

    relays = False
    has_new_picture = False

    def __init__(self, path: Path, messages: MessageSet) -> None:
        self._path, self._end_id = path, messages.id(RECORDING_END)
        self._now = 0

    def now(self) -> int:
        return self._now

    def steps(self, period: Fraction | int, inbox: Inbox, stopped: Callable[[], bool]) -> Iterator[int]:
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

    def sent(self, frame: bytes) -> None:
        """It goes nowhere."""

    def expect(self, time: int) -> None:
        """There are no pictures."""

    def memory(self, name: str, size: int) -> SharedMemory:
        raise SharedMemoryError(f"a recording has no shared memory '{name}'")

    def close(self, stopped: Callable[[], bool]) -> None:
        """There is nothing to wait for."""

    def _arrivals(self) -> Iterator[Envelope]:
        """All messages, the end of the recording as one that was received then."""
        for envelope in read_envelopes(self._path):
            if envelope.received:
                yield envelope
            elif envelope.data_type == self._end_id:
                yield envelope._replace(received=envelope.sample_time)
                return
