"""Which frames the application left without an answer, and for how long it said nothing."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import groupby, pairwise
from typing import NamedTuple


class JudgedFrame(NamedTuple):
    """A frame by its ``order`` among others, and its ``place`` in sentences.

    ``answered`` in s of the test, None for no answer; ``expects`` one: it has true boxes that count.
    """

    order: int
    place: str
    answered: float | None
    expects: bool = True


class Unanswered(NamedTuple):
    """How many of the frames that expect an answer have none, and the longest run of those, by its ends."""

    frames: int
    silent: int
    longest: tuple[JudgedFrame, ...] = ()

    @property
    def share(self) -> float | None:
        """Of all frames that expect an answer; None where none does."""
        return self.silent / self.frames if self.frames else None


class Gap(NamedTuple):
    """A time without an answer, in s of the test."""

    begin: float
    end: float


@dataclass
class Silence:
    """Collects judged frames and the times (s) of answers; the first may come within ``start_up`` s."""

    start_up: float = 0.0
    frames: list[JudgedFrame] = field(default_factory=list)
    answers: list[float] = field(default_factory=list)

    def unanswered(self) -> Unanswered:
        """Frames without an answer; those from before a first answer within the start-up are left out."""
        frames = sorted(self.frames, key=lambda frame: frame.order)
        first = next((i for i, frame in enumerate(frames) if frame.answered is not None), None)
        if first is not None and (frames[first].answered or 0.0) <= self.start_up:
            frames = frames[first:]
        frames = [frame for frame in frames if frame.expects or frame.answered is not None]
        groups = groupby(frames, key=lambda frame: frame.answered is None)
        runs = [tuple(group) for is_silent, group in groups if is_silent]
        return Unanswered(len(frames), sum(map(len, runs)), max(runs, key=len, default=()))

    def gap(self, begin: float, end: float) -> Gap:
        """The longest time without an answer, of that from ``begin`` to ``end`` in s."""
        times: Sequence[float] = sorted(time for time in self.answers if begin <= time <= end)
        if times and times[0] <= self.start_up:
            begin = times[0]
        return max(
            (Gap(a, b) for a, b in pairwise([begin, *times, max(begin, end)])), key=lambda gap: gap.end - gap.begin
        )
