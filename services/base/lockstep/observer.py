"""What one who looks at everything sees in lockstep: each message once, and each in the step that it belongs to."""

from collections import deque
from collections.abc import Iterable

from dodo_dsl.opendlv.bus.envelope import Envelope
from services.base.clock import Inbox

EPOCH = 1_700_000_000_000_000
"""The time at which every test in lockstep begins, in microseconds since the epoch."""

LONGEST = 2 * 86_400_000_000
"""No test lasts longer, in microseconds."""

_REMEMBERED = 50


class Observed:
    """Puts together what the clock tells of the test's services, which is complete, and what else is on the bus.

    What services say is on the bus, too, sooner or later or not at all: it counts as the clock tells it. What the
    application says counts as it is on the bus, and not as the clock hands it on.
    """

    def __init__(self) -> None:
        self._overheard: list[Envelope] = []
        self._first: set[Envelope] = set()
        self._told: deque[set[Envelope]] = deque(maxlen=_REMEMBERED)

    def overhear(self, envelope: Envelope) -> None:
        """It was on the bus."""
        self._overheard.append(envelope)

    def look(self, inbox: Inbox, until: int, told: Iterable[Envelope]) -> None:
        """Let the service look at all of a step, after what the application answered to the one before.

        Its answers to this one, and what belongs to later ones, wait: whether they are there already is chance.
        """
        own = [envelope for envelope in told if not envelope.received]
        keys = {_key(envelope) for envelope in own}
        if len(self._first) < len(keys) and until <= EPOCH:
            self._first = keys  # the clock says these again to applications that start late
        self._told.append(keys)
        overheard, self._overheard = self._overheard, []
        for envelope in overheard:
            if until <= envelope.sample_time <= EPOCH + LONGEST:
                self._overheard.append(envelope)
            elif not self._is_known(_key(envelope)):
                inbox.overhear(envelope)
        for envelope in own:
            inbox.overhear(envelope)

    def rest(self, inbox: Inbox) -> None:
        """The test is over: let the service look at what waits for a step that will not come."""
        for envelope in self._overheard:
            if not self._is_known(_key(envelope)):
                inbox.overhear(envelope)
        self._overheard = []

    def _is_known(self, key: Envelope) -> bool:
        return key in self._first or any(key in keys for keys in self._told)


def _key(envelope: Envelope) -> Envelope:
    """The same for every copy of a message."""
    return envelope._replace(received=0)
