"""Whether each frame is answered: the frames of a recording or of a camera, the answers, and the verdict on them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv import recording_times
from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.recording import Recording
from services.base import Check, Evaluator, JudgedTime, UnjudgeableError, Verdict
from services.base.clock import MICROSECONDS
from services.base.evaluator import EARLY
from services.base.service import at_limit

Times = NDArray[np.int64]
"""Microseconds."""
_SAME = 1_500
"""Microseconds by which the sample time of an answer may differ from that of its frame: what rounding does."""


@dataclass(frozen=True)
class Frames:
    """The frames of a test, ascending: when each is ``due``, in us from its start, and its sample time in ``stamps``.

    Without ``stamps`` these are times of the test.
    """

    due: Times
    stamps: Times | None = None

    def of(self, sample_time: int, arrival: int, begin: int) -> int:
        """The number of the frame that is answered, -1 for none, by the sample time of an answer and its arrival in us.

        One that has not the sample time of a frame answers the last that was due when it arrived.
        """
        stamps, sought = (self.due, sample_time - begin) if self.stamps is None else (self.stamps, sample_time)
        number = int(np.searchsorted(stamps, sought + _SAME, side="right")) - 1
        if number >= 0 and sought - stamps[number] <= _SAME:
            return number
        return int(np.searchsorted(self.due, arrival - begin, side="right")) - 1


def at_rate(freq: float, seconds: float) -> Frames:
    """The frames of a camera of ``freq`` Hz in so many seconds."""
    return Frames(np.rint(np.arange(int(freq * seconds) + 1) * (MICROSECONDS / freq)).astype(np.int64))


def of_recording(
    path: Path,
    sender: int,
    start: float,
    end: float | None,
    max_gap: float,
    timemod: float,
    is_test_time: bool = False,
) -> Frames:
    """The pictures of ``sender`` as the player shows them, from ``start`` to ``end`` s; raises ValueError if none is.

    Gaps are at most ``max_gap`` s, and then all goes ``timemod`` times faster. ``is_test_time``: pictures carry the
    time of the test.
    """
    with Recording(path) as recording:
        rows, times, due = recording_times.played(recording, start, end, round(max_gap * MICROSECONDS), timemod)
        shown = np.isin(rows, recording.rows([IMAGE], sender_stamps=[sender]))
    if not shown.any():
        raise ValueError(f"{path}: has no pictures of sender {sender} in the part that is played")
    return Frames(due[shown], None if is_test_time else times[shown])


@dataclass(frozen=True)
class ResponseLimits:
    """Limits of the answers; ``delay`` and ``start_up`` in us. Values of the field are from ``low`` to ``high``.

    They are ``exact`` to a share of themselves.
    """

    share: float
    frames: int
    delay: int
    start_up: int
    low: float | None = None
    high: float | None = None
    exact: float = 0.0


class ResponseEvaluator(Evaluator):
    """Consumes answers; ``name`` is theirs in sentences, ``field`` the one with bounds, empty for none."""

    def __init__(self, name: str, field: str, frames: Frames, limits: ResponseLimits, max_time: float) -> None:
        super().__init__(max_time, limits.delay / MICROSECONDS)
        self._name, self._field, self._frames, self._limits = name, field, frames, limits
        self._shown = np.ones(len(frames.due), np.bool_)
        if field:
            self.plot = self.judged.series(f"{field} of {name}", low=limits.low, high=limits.high)
        else:
            self.plot = self.judged.series(f"delay of {name}", "s", high=limits.delay / MICROSECONDS)
        self._clear()

    def _clear(self) -> None:
        self._answered = np.zeros(len(self._frames.due), np.bool_)
        self._received = self._late = self._broken = 0
        self._first_broken: tuple[str, float] | None = None
        """The field, and the time in s."""
        self._lowest = self._highest = self._delay = None

    _lowest: float | None
    _highest: float | None
    _delay: float | None

    def forget(self, now: int) -> None:
        self._clear()

    def not_shown(self, message: Any, due: int) -> None:
        self._shown[message.number : message.number + 1] = False

    def take(self, values: Mapping[str, float], sample_time: int) -> None:
        """An answer with the numbers that are judged, by their fields."""
        arrival = self.arrival
        if self.verdict is not None or arrival is None:
            return
        self._received += 1
        number = self._frames.of(sample_time, arrival, self.zero)
        while number >= 0 and not self._shown[number]:
            number -= 1
        due = self.zero + int(self._frames.due[number]) if number >= 0 else arrival
        delay = arrival - due
        self._judge(values, due)
        if not self._field:
            self.plot.add(due, delay / MICROSECONDS)
        if number < 0 or delay > self._limits.delay or delay < -EARLY:
            self._late += 1
        elif not self._answered[number]:
            self._answered[number] = True
            self._delay = max(self._delay or 0.0, delay / MICROSECONDS)

    def _judge(self, values: Mapping[str, float], time: int) -> None:
        for field, sent in values.items():
            value = sent
            if not np.isfinite(value):
                self._broken += 1
                self._first_broken = self._first_broken or (field, self.elapsed(time))
            elif field == self._field:
                limits, exact = self._limits, self._limits.exact * abs(value)
                value = at_limit(at_limit(value, limits.low, exact), limits.high, exact)
                self._lowest = value if self._lowest is None else min(self._lowest, value)
                self._highest = value if self._highest is None else max(self._highest, value)
            if field == self._field:
                self.plot.add(time, value)

    def decide(self, span: JudgedTime) -> Verdict:
        due, limits = self._frames.due, self._limits
        now = self.now or self.zero
        asked = np.flatnonzero(((due + limits.delay <= now - self.zero) | self._answered) & self._shown)
        came = int((self._shown & (due <= (self._ended or now) - self.zero)).sum())
        if not len(asked):
            raise UnjudgeableError(f"no frame came {span.within}, so there was nothing to answer")
        if came < limits.frames:
            raise UnjudgeableError(f"only {came} frames came {span.within}, and {limits.frames} have to be answered")
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
        is_soon = len(answered) and self._frames.due[answered[0]] <= self._limits.start_up
        return asked[asked >= answered[0]] if is_soon else asked

    def checks(self, answered: int, judged: int) -> Iterator[Check]:
        limits, broken = self._limits, self._broken
        share, low, high = answered / judged, self._lowest, self._highest
        yield Check.least("share", share, limits.share)
        yield Check.least("frames", answered, limits.frames)
        if limits.low is not None:
            yield Check.least("lowest", low, limits.low, parameters=("min",))
        if limits.high is not None:
            yield Check.most("highest", high, limits.high, parameters=("max",))
        yield Check.most("broken", broken, 0)
        yield Check("late", self._late)
        yield Check("delay", self._delay, {}, "s")

    def _fault(self, check: Check, judged: Times) -> str:
        if check.name == "share":
            return f"answered {int(self._answered[judged].sum())} of {len(judged)} frames in time, a share of " + (
                f"{check.told} ({check.bound}){self._longest(judged)}"
            )
        if check.name == "frames":
            return f"only {check.value} frames were answered ({check.bound})"
        if check.name == "broken" and self._first_broken:
            field, time = self._first_broken
            what = (
                "1 value is not a finite number" if check.value == 1 else f"{check.value} values are not finite numbers"
            )
            return f"{what}, the first is {field} at {time:.2f} s"
        return f"the {check.name} {self._field} is {check.told} ({check.bound})"

    def _longest(self, judged: Times) -> str:
        """Where the longest run of frames without an answer is."""
        silent = np.append(self._answered[judged], True)
        ends = np.flatnonzero(silent)
        lengths = np.diff(ends, prepend=-1) - 1
        last = int(ends[np.argmax(lengths)]) - 1
        first = last - int(lengths.max()) + 1
        begin, end = (self._frames.due[judged[number]] / MICROSECONDS for number in (first, last))
        run = last - first + 1
        return f", the longest run is {run} frame{'' if run == 1 else 's'}, from {begin:.2f} s to {end:.2f} s"

    def _aside(self) -> str:
        if not self._late:
            return ""
        what = "1 answer" if self._late == 1 else f"{self._late} answers"
        return f"; {what} came later than {self._limits.delay / MICROSECONDS:g} s after the frame, or before it"
