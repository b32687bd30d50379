"""How much of a time samples cover, and where they leave it open."""

from dataclasses import dataclass

import numpy as np

from services.continuous_signal.target import MICROSECONDS, Times, Values


@dataclass(frozen=True)
class Coverage:
    """The judged time, which share of it samples hold, and its longest gap without one; all times in s.

    Without samples the gap is the whole time.
    """

    begin: float
    end: float
    share: float
    gap_begin: float
    gap_end: float

    @property
    def gap(self) -> float:
        """The length of the longest gap, in s."""
        return self.gap_end - self.gap_begin


def holds(times: Times, end: int, longest: int) -> Values:
    """How long each sample holds, in us: until the next or the `end`, and at most `longest`; `times` ascend."""
    found: Values = np.minimum(np.diff(np.append(times, end)), longest).astype(np.float64)
    return found


def cover(times: Times, begin: int, end: int, longest: int) -> Coverage:
    """What samples cover of the time from `begin` to `end`; `times` ascend and are inside it, all in us."""
    edges = np.concatenate([[begin], times, [end]])
    gaps = np.diff(edges)
    at = int(np.argmax(gaps))
    share = float(holds(times, end, longest).sum()) / (end - begin)
    return Coverage(*(float(each) for each in (
        begin / MICROSECONDS, end / MICROSECONDS, share, edges[at] / MICROSECONDS, edges[at + 1] / MICROSECONDS,
    )))  # fmt: skip
