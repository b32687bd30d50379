"""The evaluator of answers on the bus: whether each frame has one, in time and with values within bounds."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from services.base import Check, Context, Evaluator, Flags, JudgedTime, UnjudgeableError, Verdict
from services.base.clock import MICROSECONDS
from services.base.evaluator import EARLY
from services.base.service import SINGLE, at_limit
from services.responds.model import Frames, Times, at_rate, of_recording


class Responds(Evaluator):
    """Takes the answers under their sender stamp."""

    def __init__(self, context: Context) -> None:
        """Raises ValueError for flags that leave something open."""
        self._flags = flags = context.flags
        super().__init__(flags["max-time"], flags["max-delay"])
        self._name, self._field = f"{flags['message']}/{flags['sender']}", flags["field"] or ""
        numbers = context.messages.layout(flags["message"]).definition.numbers
        _check(flags, numbers)
        self._fields = [self._field] if self._field else [*numbers]
        self._exact = SINGLE if numbers.get(self._field) else 0.0
        self._frames, self._delay = _frames(flags), round(flags["max-delay"] * MICROSECONDS)
        self._shown = np.ones(len(self._frames.due), np.bool_)
        if self._field:
            self.plot = self.judged.series(f"{self._field} of {self._name}", low=flags["min"], high=flags["max"])
        else:
            self.plot = self.judged.series(f"delay of {self._name}", "s", high=flags["max-delay"])
        self.inputs = {(flags["message"], flags["sender"]): self._take}
        self.forget(0)

    def forget(self, now: int) -> None:
        self._answered = np.zeros(len(self._frames.due), np.bool_)
        self._received = self._late = self._broken = 0
        self._first_broken: tuple[str, float] | None = None
        """The field, and the time in s."""
        self._lowest: float | None = None
        self._highest: float | None = None
        self._longest: float | None = None
        """From a frame to its first answer, in s."""

    def not_shown(self, message: Any, due: int) -> None:
        self._shown[message.number : message.number + 1] = False

    def _take(self, message: Any, sample_time: int) -> None:
        arrival = self.arrival
        if self.verdict is not None or arrival is None:
            return
        self._received += 1
        number = self._frames.of(sample_time, arrival, self.zero)
        while number >= 0 and not self._shown[number]:
            number -= 1
        due = self.zero + int(self._frames.due[number]) if number >= 0 else arrival
        delay = arrival - due
        for field in self._fields:
            self._judge(field, float(getattr(message, field)), due)
        if not self._field:
            self.plot.add(due, delay / MICROSECONDS)
        if number < 0 or delay > self._delay or delay < -EARLY:
            self._late += 1
        elif not self._answered[number]:
            self._answered[number] = True
            self._longest = max(self._longest or 0.0, delay / MICROSECONDS)

    def _judge(self, field: str, value: float, time: int) -> None:
        if not np.isfinite(value):
            self._broken += 1
            self._first_broken = self._first_broken or (field, self.elapsed(time))
        elif field == self._field:
            for limit in (self._flags["min"], self._flags["max"]):
                value = at_limit(value, limit, self._exact * abs(value))
            self._lowest = value if self._lowest is None else min(self._lowest, value)
            self._highest = value if self._highest is None else max(self._highest, value)
        if field == self._field:
            self.plot.add(time, value)

    def decide(self, span: JudgedTime) -> Verdict:
        due, least = self._frames.due, self._flags["min-frames"]
        now = self.now or self.zero
        asked = np.flatnonzero(((due + self._delay <= now - self.zero) | self._answered) & self._shown)
        came = int((self._shown & (due <= (self._ended or now) - self.zero)).sum())
        if not len(asked):
            raise UnjudgeableError(f"no frame came {span.within}, so there was nothing to answer")
        if came < least:
            raise UnjudgeableError(f"only {came} frames came {span.within}, and {least} have to be answered")
        judged = self._from_first(asked)
        answered = int(self._answered[judged].sum())
        checks = tuple(self.checks(answered, len(judged)))
        evidence = {"time": self._first_broken[1]} if self._first_broken else {}
        if not self._received:
            return Verdict("failed", f"no {self._name} came {span.within}", checks, silent=True)
        faults = [self._fault(check, judged) for check in checks if not check.ok]
        if faults:
            return Verdict("failed", "; ".join(faults) + self._aside(), checks, evidence=evidence)
        values = f", {self._field} from {self._lowest:z.4g} to {self._highest:z.4g}" if self._field else ""
        if self._field and self._lowest == self._highest and self._received > 1:
            self.notes = [f"all {self._received} answers have the same {self._field}, {self._lowest:z.4g}"]
        said = f"answered {answered} of {len(judged)} frames with {self._name}{values}"
        return Verdict("passed", said + self._aside(), checks)

    def _from_first(self, asked: Times) -> Times:
        answered = np.flatnonzero(self._answered)
        is_soon = len(answered) and self._frames.due[answered[0]] <= round(self._flags["start-up"] * MICROSECONDS)
        return asked[asked >= answered[0]] if is_soon else asked

    def checks(self, answered: int, judged: int) -> Iterator[Check]:
        flags = self._flags
        yield Check.least("share", answered / judged, flags["min-share"])
        yield Check.least("frames", answered, flags["min-frames"])
        if flags["min"] is not None:
            yield Check.least("lowest", self._lowest, flags["min"], parameters=("min",))
        if flags["max"] is not None:
            yield Check.most("highest", self._highest, flags["max"], parameters=("max",))
        yield Check.most("broken", self._broken, 0)
        yield Check("late", self._late)
        yield Check("delay", self._longest, {}, "s")

    def _fault(self, check: Check, judged: Times) -> str:
        said = f"{check.told} ({check.bound})"
        if check.name == "share":
            count = f"{int(self._answered[judged].sum())} of {len(judged)}"
            return f"answered {count} frames in time, a share of {said}{self._silence(judged)}"
        if check.name == "frames":
            return f"only {check.value} frames were answered ({check.bound})"
        if check.name == "broken" and self._first_broken:
            field, time = self._first_broken
            are = "value is not a finite number" if check.value == 1 else "values are not finite numbers"
            return f"{check.value} {are}, the first is {field} at {time:.2f} s"
        return f"the {check.name} {self._field} is {said}"

    def _silence(self, judged: Times) -> str:
        """Where the longest run of frames without an answer is."""
        ends = np.flatnonzero(np.append(self._answered[judged], True))
        lengths = np.diff(ends, prepend=-1) - 1
        run, last = int(lengths.max()), int(ends[np.argmax(lengths)]) - 1
        begin, end = (self._frames.due[judged[number]] / MICROSECONDS for number in (last - run + 1, last))
        return f", the longest run is {run} frame{'' if run == 1 else 's'}, from {begin:.2f} s to {end:.2f} s"

    def _aside(self) -> str:
        if not self._late:
            return ""
        what = "1 answer" if self._late == 1 else f"{self._late} answers"
        return f"; {what} came later than {self._flags['max-delay']:g} s after the frame, or before it"


build = Responds


def _check(flags: Flags, numbers: Any) -> None:
    low, high, field = flags["min"], flags["max"], flags["field"]
    if field and field not in numbers:
        raise ValueError(f"{flags['message']} has no number '{field}', expected one of {', '.join(numbers) or 'none'}")
    if (low is not None or high is not None) and not field:
        raise ValueError("--min and --max need --field, the number that they are bounds of")
    if low is not None and high is not None and low > high:
        raise ValueError(f"--min={low:g} is more than --max={high:g}")
    if flags["max-delay"] >= flags["max-time"]:
        raise ValueError("no frame would be judged: --max-time must be longer than --max-delay")


def _frames(flags: Flags) -> Frames:
    if not flags["rec"]:
        return at_rate(flags["freq"], flags["max-time"])
    sender, start, timemod = flags["video-sender"] or 0, flags["start"] or 0.0, flags["timemod"] or 1.0
    is_test_time = flags["sample-times"] == "test"
    return of_recording(Path(flags["rec"]), sender, start, flags["end"], flags["max-gap"], timemod, is_test_time)
