"""Truth that is withheld from the bus until the application's answer no longer counts."""

import os
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Self

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.messages.message_set import MessageSet

VARIABLE = "DODO_TRUTH"
"""Environment variable with the seconds for which truth is withheld in real time, and with its messages."""


@dataclass
class WithheldTruth:
    """Messages (id and sender stamp; None for any) by which evaluators judge, kept for ``delay`` us.

    In lockstep they never come to the bus, as evaluators get them from the clock.
    """

    messages: frozenset[tuple[int, int | None]] = frozenset()
    delay: int = 0
    _kept: deque[tuple[int, Envelope]] = field(default_factory=deque)

    @classmethod
    def load(cls, messages: MessageSet) -> Self:
        """What the environment names, nothing without it."""
        seconds, *words = os.environ.get(VARIABLE, "").split() or ["0"]
        ids = (each.partition("/") for each in words)
        named = frozenset((messages.id(name), int(stamp) if stamp else None) for name, _, stamp in ids)
        return cls(named, round(float(seconds) * 1e6))

    def holds(self, envelope: Envelope) -> bool:
        """Whether a message is one of them."""
        return not self.messages.isdisjoint(((envelope.data_type, envelope.sender_stamp), (envelope.data_type, None)))

    def keep(self, envelope: Envelope, now: int) -> None:
        """A message that would be sent at ``now``, in us of test time."""
        self._kept.append((now + self.delay, envelope))

    def due(self, now: int | None = None) -> Iterator[Envelope]:
        """Those to send now; all that are left without a time."""
        while self._kept and (now is None or self._kept[0][0] <= now):
            yield self._kept.popleft()[1]
