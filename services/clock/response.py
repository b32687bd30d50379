"""How long the application takes for an answer: what lockstep hides, as the world waits for it."""

import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from services.clock.processor_time import Spent

_FIRST_FRAME = 2
"""The one of the first answer that counts."""


@dataclass
class ResponseTimes:
    """The answers of a test, without the first, for which programs load their libraries; times in s.

    An answer's time is the wall time from the frame to the answer less what the application, or the clock itself,
    waited for a processor, and at least the processor time that it took, up to the wall time. ``limit_s`` is the
    longest that an answer may take, ``period_s`` the period of the frames.
    """

    period_s: float = 0.1
    limit_s: float | None = None
    uncopied: int = 0
    """Answers that did not carry the sample time of their frame."""
    _taken: list[float] = field(default_factory=list)
    _processor: list[float] = field(default_factory=list)

    def add(self, wall_s: float, spent: Spent | None, is_copied: bool = True) -> None:
        """One more answer; ``spent`` is None where the application's processes cannot be seen."""
        self.uncopied += not is_copied
        if spent is None:
            self._taken.append(wall_s)
            return
        self._processor.append(spent.ran_s)
        self._taken.append(max(wall_s - spent.waited_s, min(spent.ran_s, wall_s), 0.0))

    def facts(self) -> dict[str, Any]:
        """What the clock reports: numbers in s, none without an answer; ``over`` counts answers beyond the limit."""
        if not self._taken:
            return {}
        return {
            "answers": len(self._taken),
            "period_s": self.period_s,
            "median_s": statistics.median(self._taken),
            "p95_s": _percentile(self._taken, 0.95),
            "worst_s": max(self._taken),
            "processor_median_s": statistics.median(self._processor) if self._processor else None,
            "processor_p95_s": _percentile(self._processor, 0.95) if self._processor else None,
            "processor_worst_s": max(self._processor, default=None),
            "slow": sum(taken > self.period_s for taken in self._taken),
            "worst_frame": self._taken.index(max(self._taken)) + _FIRST_FRAME,
            "uncopied": self.uncopied,
            "over": None if self.limit_s is None else sum(taken > self.limit_s for taken in self._taken),
            "processor": processor_name(),
        }


def _percentile(values: Sequence[float], share: float) -> float:
    """The smallest value that at least this share of the values does not exceed."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, max(0, -int(-share * len(ordered) // 1) - 1))]


def processor_name(cpuinfo: Path = Path("/proc/cpuinfo")) -> str:
    """The processor as Linux names it, with its clock where it says one; empty where it says nothing."""
    try:
        lines = cpuinfo.read_text(errors="replace").splitlines()
    except OSError:
        return ""
    facts = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in reversed(lines))}
    name = facts.get("model name") or facts.get("Model") or facts.get("Hardware") or ""
    clock = facts.get("cpu MHz", "")
    return f"{name}, {float(clock):.0f} MHz" if name and clock.replace(".", "", 1).isdigit() else name
