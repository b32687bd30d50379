"""How late a service is against its schedule in real time."""

from fractions import Fraction

from services.base.clock import MICROSECONDS

SHORTEST = 10_000
"""Microseconds; less is no harm to a test, and usual on any machine."""


class Lateness:
    """Counts updates that end late from ``begin`` on. Times in microseconds of test time."""

    def __init__(self, period: Fraction | int | None, late_after: float | None) -> None:
        self._period = period or 0
        self._late_after = max(float(self._period) / 2, SHORTEST) if late_after is None else late_after
        self._last: int | None = None
        self._has_begun = False
        self._updates = self._late = self._reported = 0
        self._worst = 0

    def begin(self) -> None:
        """The test begins."""
        self._has_begun = True

    def add(self, due: int, ended: int) -> None:
        """The update of the instant ``due`` has ended. Instants between the last one and this were skipped, so late."""
        skipped = round((due - self._last) / self._period) - 1 if self._last is not None and self._period else 0
        self._last = due
        if not self._has_begun:
            return
        late = ended - due
        self._updates += 1 + max(skipped, 0)
        self._late += (late > self._late_after) + max(skipped, 0)
        self._worst = max(self._worst, late)

    def news(self) -> dict[str, int | float] | None:
        """What is to report, when more were late than at the last report."""
        if self._late == self._reported:
            return None
        self._reported = self._late
        return {"updates": self._updates, "late": self._late, "worst_s": round(self._worst / MICROSECONDS, 3)}
