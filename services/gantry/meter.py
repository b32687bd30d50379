"""How evenly the rig is told to move, and how long it takes to answer."""

from array import array

import numpy as np

MOST = 1_000_000
"""Turns that are counted: 14 hours at 20 Hz."""


class Meter:
    """Notes turns of ``period`` s; its text is one line with the jitter of RUN and the latency of POSITION in ms."""

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
        return _summary(np.abs(np.diff(np.array(self._began)) - self._period))

    @property
    def latency(self) -> tuple[float, float, float]:
        """Median, 95 % and largest time (s) from RUN, POSITION and STATUS to the last of the answers."""
        return _summary(np.array(self._took))

    def __str__(self) -> str:
        missed = len(self._began) - len(self._took)
        return (
            f"{len(self._began)} turns of {1000 * self._period:g} ms, {missed} without an answer; "
            f"jitter {_text(self.jitter)}; position after {_text(self.latency)}"
        )


def _summary(values: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]") -> tuple[float, float, float]:
    if not len(values):
        return 0.0, 0.0, 0.0
    return float(np.median(values)), float(np.quantile(values, 0.95)), float(values.max())


def _text(summary: tuple[float, float, float]) -> str:
    middle, most, largest = (1000 * value for value in summary)
    return f"median {middle:.1f} ms, 95 % {most:.1f} ms, max {largest:.1f} ms"
