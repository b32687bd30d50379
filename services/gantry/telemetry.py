"""How evenly commands are sent to the rig, and how long it takes to answer."""

import statistics
from array import array
from collections.abc import Sequence
from itertools import pairwise

MOST = 1_000_000
"""Turns that are counted: 14 hours at 20 Hz."""


class LinkTelemetry:
    """Notes turns of ``period`` s; as a string one line with the jitter of RUN and the latency of POSITION in ms."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._began, self._took = array("d"), array("d")

    def note(self, began: float, answered: float | None) -> None:
        """A turn: when its commands were sent, and when all answers were there (s); None where they were not."""
        if len(self._began) < MOST:
            self._began.append(began)
            if answered is not None:
                self._took.append(answered - began)

    @property
    def jitter(self) -> tuple[float, float, float]:
        """Median, 95 % and largest distance (s) of a period from the one that it should be; 0 before two turns."""
        return _summary([abs(after - before - self._period) for before, after in pairwise(self._began)])

    @property
    def latency(self) -> tuple[float, float, float]:
        """Median, 95 % and largest time (s) from RUN, POSITION and STATUS to the last of the answers."""
        return _summary(self._took)

    def __str__(self) -> str:
        missed = len(self._began) - len(self._took)
        return (
            f"{len(self._began)} turns of {1000 * self._period:g} ms, {missed} without an answer; "
            f"jitter {_text(self.jitter)}; position after {_text(self.latency)}"
        )


def _summary(values: Sequence[float]) -> tuple[float, float, float]:
    if len(values) < 2:
        return (values[0],) * 3 if values else (0.0, 0.0, 0.0)
    return statistics.median(values), statistics.quantiles(values, n=20, method="inclusive")[-1], max(values)


def _text(summary: tuple[float, float, float]) -> str:
    middle, most, largest = (1000 * value for value in summary)
    return f"median {middle:.1f} ms, 95 % {most:.1f} ms, max {largest:.1f} ms"
