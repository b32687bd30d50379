"""How many rounds a benchmark measures: as many as it likes, or as its budget of seconds allows."""

import os
import time
from collections.abc import Callable, Iterator

VARIABLE = "DODO_BENCH_SECONDS"


class Budget:
    """Seconds from now on. Without a limit every loop has all its rounds."""

    def __init__(self, seconds: float | None, clock: Callable[[], float] = time.monotonic) -> None:
        self._seconds, self._clock, self._start = seconds, clock, clock()

    @classmethod
    def given(cls) -> "Budget":
        """That of the environment, which the ledger sets."""
        seconds = os.environ.get(VARIABLE)
        return cls(float(seconds) if seconds else None)

    @property
    def limited(self) -> bool:
        return self._seconds is not None

    def left(self, until: float = 1.0) -> float:
        """Seconds to this part of the budget."""
        used = self._clock() - self._start
        return float("inf") if self._seconds is None else self._seconds * until - used

    def rounds(self, most: int, until: float = 1.0) -> Iterator[int]:
        """Numbers of rounds: always one, and further ones while the longest so far fits into this part of the budget.

        Until there are three rounds, the whole budget is free for them.
        """
        longest = 0.0
        for number in range(most):
            if number and self.left(until if number >= 3 else 1.0) < longest:
                return
            begin = self._clock()
            yield number
            longest = max(longest, self._clock() - begin)
