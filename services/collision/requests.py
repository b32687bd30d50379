"""The application's requests: which came, and for how long none did."""

import math
from collections.abc import Sequence

from services.base import Check

MICROSECONDS = 1_000_000
REQUESTS = ("opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest")


class Requests:
    """Requests by message names; ``max_silence`` s may pass between any two of them. Times in us.

    Time before the first request is not silence: ``max_time`` limits that.
    """

    def __init__(self, names: Sequence[str] = REQUESTS, max_silence: float = math.inf) -> None:
        self.names = tuple(names)
        self.came: set[str] = set()
        self._max_silence = max_silence
        self._last: int | None = None
        self._longest = 0

    def take(self, name: str, now: int | None) -> None:
        """The application sent a request; ``now`` is None while no time is known."""
        self.came.add(name)
        if now is not None:
            self.elapse(now)
            self._last = max(now, self._last or 0)

    def elapse(self, now: int) -> None:
        """Time passes without a request."""
        if self.came and self._last is None:
            self._last = now
        if self._last is not None:
            self._longest = max(self._longest, now - self._last)

    def forget(self, now: int) -> None:
        """The test begins: silence before it does not count."""
        self._last, self._longest = now if self.came else None, 0

    @property
    def missing(self) -> list[str]:
        """Those that never came, by their short names."""
        return [name.rpartition(".")[2] for name in self.names if name not in self.came]

    @property
    def is_silent(self) -> bool:
        """Whether none came at all."""
        return not self.came

    def fault(self, now: int, zero: int) -> str | None:
        """That no request came for too long up to now; None when that is not so."""
        self.elapse(now)
        if self._last is None or now - self._last <= self._max_silence * MICROSECONDS:
            return None
        begin, end = ((each - zero) / MICROSECONDS for each in (self._last, now))
        return f"no request came between {begin:.2f} s and {end:.2f} s (at most {self._max_silence:g} s)"

    def checks(self) -> tuple[Check, ...]:
        """The longest silence in s, where that has a limit."""
        if math.isinf(self._max_silence):
            return ()
        longest = self._longest / MICROSECONDS if self.came else None
        is_kept = longest is not None and longest <= self._max_silence
        return (Check("silence", longest, {"max": self._max_silence}, "s", is_kept),)
