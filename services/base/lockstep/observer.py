"""What a service that observes the bus gets in lockstep: each message once, in the step that it belongs to."""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence

from dodo_dsl.opendlv.bus.envelope import Envelope
from services.base.clock import Inbox

EPOCH = 1_700_000_000_000_000
"""The time at which every test in lockstep begins, in microseconds since the epoch."""

LONGEST = 2 * 86_400_000_000
"""Longest test, in microseconds."""

_REMEMBERED = 50
_Key = tuple[int, bytes, int, int, int]


class Observer:
    """Merges the messages of the test's services, which the clock passes on completely, with the rest of the bus.

    Messages of services may be on the bus, too, early or late: those from the clock count. Messages of the application
    count as they are on the bus, not as the clock passes them on. ``marked`` adds to a step (its time in us, and all
    messages that the clock passes on) what tells a recording how it went.
    """

    def __init__(self, marked: Callable[[int, Sequence[Envelope]], Iterable[Envelope]] | None = None) -> None:
        self._marked = marked
        self._collected: list[Envelope] = []
        self._first: set[_Key] = set()
        self._relayed: deque[set[_Key]] = deque()
        self._counts: Counter[_Key] = Counter()
        """In how many of the sets each key is."""

    def collect(self, envelope: Envelope) -> None:
        """An envelope that was on the bus."""
        self._collected.append(envelope)

    def deliver(self, inbox: Inbox, until: int, relayed: Sequence[Envelope]) -> None:
        """Deliver all of a step (its end ``until`` in us), after the application's answer to the one before.

        The answer to this one, and what belongs to later ones, waits: whether it is there already is chance.
        """
        own = [envelope for envelope in relayed if not envelope.received]
        keys = {_key(envelope) for envelope in own}
        if len(self._first) < len(keys) and until <= EPOCH:
            self._first = keys  # the clock repeats these for applications that start late
        self._remember(keys)
        collected, self._collected = self._collected, []
        for envelope in collected:
            if until <= envelope.sample_time <= EPOCH + LONGEST:
                self._collected.append(envelope)
            elif not self._is_known(_key(envelope)):
                inbox.observe(envelope)
        for envelope in self._marked(until, relayed) if self._marked else own:
            inbox.observe(envelope)

    def flush(self, inbox: Inbox) -> None:
        """The test is over: deliver what waits for a step that will not come."""
        for envelope in self._collected:
            if not self._is_known(_key(envelope)):
                inbox.observe(envelope)
        self._collected = []

    def _remember(self, keys: set[_Key]) -> None:
        self._relayed.append(keys)
        self._counts.update(keys)
        if len(self._relayed) > _REMEMBERED:
            for key in self._relayed.popleft():
                self._counts[key] -= 1
                if not self._counts[key]:
                    del self._counts[key]

    def _is_known(self, key: _Key) -> bool:
        return key in self._first or key in self._counts


def _key(envelope: Envelope) -> _Key:
    """The same for every copy of a message."""
    return envelope.data_type, envelope.payload, envelope.sent, envelope.sample_time, envelope.sender_stamp
