"""The evaluator of answers on the bus."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from services.base import Context, Flags
from services.base.clock import MICROSECONDS
from services.base.service import SINGLE
from services.responds.model import Frames, ResponseEvaluator, ResponseLimits, at_rate, of_recording


class Responds(ResponseEvaluator):
    """Takes the answers under their sender stamp."""

    def __init__(self, context: Context) -> None:
        """Raises ValueError for flags that leave something open."""
        flags = context.flags
        message, field = flags["message"], flags["field"] or ""
        numbers = context.messages.layout(message).definition.numbers
        if field and field not in numbers:
            raise ValueError(f"{message} has no number '{field}', expected one of {', '.join(numbers) or 'none'}")
        self._fields = [field] if field else [*numbers]
        limits = replace(_limits(flags), exact=SINGLE if numbers.get(field) else 0.0)
        super().__init__(f"{message}/{flags['sender']}", field, _frames(flags), limits, flags["max-time"])
        self.inputs = {(flags["message"], flags["sender"]): self._take}

    def _take(self, message: Any, sample_time: int) -> None:
        self.take({field: float(getattr(message, field)) for field in self._fields}, sample_time)


build = Responds


def _frames(flags: Flags) -> Frames:
    if not flags["rec"]:
        return at_rate(flags["freq"], flags["max-time"])
    return of_recording(
        Path(flags["rec"]),
        flags["video-sender"] or 0,
        flags["start"] or 0.0,
        flags["end"],
        flags["max-gap"],
        flags["timemod"] or 1.0,
        flags["sample-times"] == "test",
    )


def _limits(flags: Flags) -> ResponseLimits:
    low, high = flags["min"], flags["max"]
    if (low is not None or high is not None) and not flags["field"]:
        raise ValueError("--min and --max need --field, the number that they are bounds of")
    if low is not None and high is not None and low > high:
        raise ValueError(f"--min={low:g} is more than --max={high:g}")
    if flags["max-delay"] >= flags["max-time"]:
        raise ValueError("no frame would be judged: --max-time must be longer than --max-delay")
    delay, start_up = (round(flags[name] * MICROSECONDS) for name in ("max-delay", "start-up"))
    return ResponseLimits(flags["min-share"], flags["min-frames"], delay, start_up, low, high)
