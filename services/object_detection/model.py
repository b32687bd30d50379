"""The evaluator of a perception: the application's boxes against the true ones, frame by frame.

The verdict is one sentence.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from operator import attrgetter

from services.base import Check, Evaluator, Flags, JudgedBoxes, JudgedTime, UnjudgeableError, Verdict
from services.base.clock import MICROSECONDS
from services.base.evaluator import EARLY
from services.object_detection.boxes import Box, DetectedFrame, Detections, FrameKey, LabelledBox, Truth, Value
from services.object_detection.score import (
    KINDS,
    MEASURES,
    SMALL,
    CountsByClass,
    JudgedFrame,
    Score,
    Silence,
    areas,
    compare,
)


def verdict(score: Score, flags: Flags, during: str) -> Verdict:
    """Passed when every limit is kept; ``during`` is the observed time in words."""
    checks = score.checks(flags)
    if not score.answered:
        return Verdict("failed", _silence(score, during), checks)
    broken = [check for check in checks if not check.ok]
    if broken:
        faults = [_fault(check, score) for check in _telling(broken, [label for label, _ in score.counts])]
        return Verdict("failed", "; ".join(faults) + _kinds(score) + _worst(score) + _aside(score), checks)
    total = score.counts.total()
    kept = ", ".join(f"{check.name} {check.told} ({check.bound})" for check in checks[: len(MEASURES)] if check.limit)
    found = f"found {total.hits} of {total.hits + total.missed} objects in {_count(score.frames, 'frame')}"
    return Verdict("passed", f"{found}, with {_count(total.false, 'false detection')}: {kept}{_aside(score)}", checks)


def _telling(broken: Sequence[Check], labels: Sequence[str]) -> list[Check]:
    """Without those that others imply: F1 beside precision or recall, and classes where all of them fail alike."""
    names = {check.name for check in broken}
    told = []
    for check in broken:
        measure, _, label = check.name.partition("-")
        of = f"-{label}" if label else ""
        is_implied = measure == "f1" and bool({f"precision{of}", f"recall{of}"} & names)
        alike = {f"{measure}-{each or 'unnamed'}" for each in labels}
        if not is_implied and not (label and measure in MEASURES and {measure, *alike} <= names):
            told.append(check)
    return told


def _silence(score: Score, during: str) -> str:
    if not score.without_truth:
        return f"no detection came {during}" + (f", in {_count(score.frames, 'frame')}" if score.frames else "")
    others = _count(score.without_truth, "frame")
    return f"none of {others} with detections has ground truth: is their sample time that of the picture?"


def _fault(check: Check, score: Score) -> str:
    bound = check.bound
    if check.name == "answered":
        if score.frames > score.answered:
            return f"answered {score.answered} of {_count(score.frames, 'frame')} ({bound})"
        return f"only {_count(score.answered, 'frame')} had an answer ({bound})"
    if check.name == "unanswered":
        return _unanswered(check, score)
    if check.name == "gap" and score.gap:
        return f"no answer came between {score.gap.begin:.2f} s and {score.gap.end:.2f} s ({bound} s)"
    measure, _, label = check.name.partition("-")
    name = f"{'F1' if measure == 'f1' else measure}{f' of {label}' if label else ''}"
    if check.value is None:
        return f"{name} has no value ({bound}), because {_nothing(measure)}"
    counts = {each or "unnamed": of for each, of in score.counts}[label] if label else score.counts.total()
    wrong = {"precision": _count(counts.false, "false detection"), "recall": f"{counts.missed} missed"}
    both = f"{wrong['precision']} and {wrong['recall']}"
    return f"{name} is {check.told} ({bound}), with {wrong.get(measure, both)} beside {counts.hits} found"


def _unanswered(check: Check, score: Score) -> str:
    count, frames, longest = score.unanswered.silent, score.unanswered.frames, score.unanswered.longest
    said = f"{count} of {_count(frames, 'frame')} had no answer, a share of {check.told} ({check.bound})"
    first, last = (frame.place.partition(" ")[2] for frame in (longest[0], longest[-1]))
    if len(longest) == 1:
        return f"{said}, such as the one {longest[0].place}"
    return f"{said}, the longest run is {len(longest)} frames, from {first} to {last}"


def _nothing(measure: str) -> str:
    return {"precision": "nothing was detected", "recall": "there was nothing to detect"}.get(
        measure, "there was nothing"
    )


def _kinds(score: Score) -> str:
    kinds = ", ".join(f"{count} {KINDS[kind]}" for kind, count in score.counts.kinds.most_common())
    missed, found = (sum(each) / max(1, len(each)) for each in (score.counts.missed, score.counts.found))
    sizes = f"{missed:.2g} of the picture's height on average, and found ones {found:.2g}"
    small = f"; missed objects are small: {sizes}" if 0.0 < missed < SMALL * found else ""
    return (f"; false detections: {kinds}" if kinds else "") + small


def _worst(score: Score) -> str:
    if score.worst is None:
        return ""
    counts = score.worst.counts
    return f"; worst was the frame {score.worst.place}, with {counts.false} false and {counts.missed} missed"


def _aside(score: Score) -> str:
    notes = [
        f"{_count(score.without_truth, 'frame')} without ground truth" if score.without_truth else "",
        f"{_count(score.late, 'detection')} too late" if score.late else "",
        f"{_count(score.early, 'detection')} of the future" if score.early else "",
        f"{_count(score.repeated, 'detection')} under a detectionId that was in use" if score.repeated else "",
    ]
    left_out = ", ".join(note for note in notes if note)
    return f"; left out: {left_out}" if left_out else ""


def _count(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


_found, _true = attrgetter("found"), attrgetter("true")

_OTHER_CLOCK = 10.0
"""Sample times farther than this, in s, from when their frame came are of another clock."""
_DAY = 86_400.0
"""The same for the boxes of recorded pictures, which have those sample times, too."""


class DetectionEvaluator(Evaluator):
    """Consumes detections, and the truth if ``truth`` is None, in test time (microseconds).

    What came before time zero, and before ``begin``, is forgotten. A frame is forgotten as soon as it is judged, but
    for its sample time.
    """

    def __init__(self, truth: Truth | None, flags: Flags) -> None:
        super().__init__(flags["max-time"], flags["max-delay"])
        self._truth, self._flags = truth, flags
        self._score, self._silence = Score(), Silence(flags["start-up"])
        self._frames: dict[int, DetectedFrame] = {}
        self._judged: set[int] = set()
        self._passed_over: set[int] = set()
        self._pictures = set(truth.pictures) if truth else set[int]()
        self._last = -1
        self._has_truth = False

    def forget(self, now: int) -> None:
        self.now = max(now, self.now or 0)
        self._score, self._silence = Score(), Silence(self._flags["start-up"])
        self._passed_over |= self._judged
        self._judged.clear()
        for frame in self._frames.values():
            self._pass_over(frame.key)
        self._frames.clear()

    def detect(self, key: FrameKey, number: int, value: Value) -> None:
        if self._is_of_the_future(key):
            self._score.early += isinstance(value, Box)
            return
        self._take(key, number, value, _found)

    def reveal(self, key: FrameKey, number: int, value: Value) -> None:
        self._has_truth = True
        self._take(key, number, value, _true)

    def announce(self, key: FrameKey, by_application: bool) -> None:
        """There is such a frame; if the application says so, it has answered it."""
        frame = None if by_application and self._is_of_the_future(key) else self._frame(key)
        if frame is not None and by_application:
            self._answer(frame)
        elif frame is not None:
            frame.has_truth = True

    def record(self) -> None:
        if self.verdict is None:  # what came of frames that nobody judges any more
            self._settle(lambda frame: True)

    def advance(self, now: int) -> None:
        patience = max(self._flags["max-delay"] * MICROSECONDS, 1)
        self._settle(lambda frame: now - frame.since >= patience)

    def decide(self, span: JudgedTime) -> Verdict:
        """At the end of the input, all frames that are left count.

        Pictures of a file that the application never answered count up to the last that it did, or all at the end.
        """
        if span.is_complete:
            self._settle(lambda frame: True)
        if self._truth is None and not self._has_truth:
            raise UnjudgeableError(f"no true box came {span.within}")
        for key in sorted(self._pictures if self._truth and self._truth.frames != "one" else ()):
            is_shown = not (self._truth and self._truth.frames == "sample-time" and self.hidden_samples.hides(key))
            if self._truth and is_shown and (span.is_complete or key < self._last):
                counts = compare((), self._truth.pictures[key], self._flags["iou"], self._flags["classes"])
                self._count(counts, key, f"of picture {key}", {"picture": key})
        if self._truth is None or span.is_complete:
            self._require_truth(span.within)
        end = self.elapsed(self.now if self._ended is None else self._ended) if self.now is not None else 0.0
        self._score.unanswered = self._silence.unanswered()
        self._score.gap = self._silence.gap(self._flags["from"], min(end, self._max_time), self._hidden)
        return replace(verdict(self._score, self._flags, span.within), evidence=self._score.evidence())

    def _require_truth(self, within: str) -> None:
        """Raises UnjudgeableError when there was nothing to find in any frame, or nothing of a class that counts."""
        if not self._score.frames:
            return
        counts = dict(self._score.counts)
        there = {label for label, each in counts.items() if each.hits + each.missed}
        missing = [label for label in self._flags["classes"] if label not in there]
        if missing and self._truth is None:
            raise UnjudgeableError(f"no true box of class '{missing[0]}' came {within}")
        if not there:
            raise UnjudgeableError(f"none of {self._score.frames} frames has a true box {within}")

    def _hidden(self, begin: float, end: float) -> float:
        """For how long nothing was shown, all in s of the test."""
        first, last = (self.zero + round(time * MICROSECONDS) for time in (begin, end))
        return (last - first - self.hidden.shown(last) + self.hidden.shown(first)) / MICROSECONDS

    def _is_of_the_future(self, key: FrameKey) -> bool:
        """A frame that comes later must not be used up."""
        return self.arrival is not None and key.time - self.arrival > EARLY

    def _answer(self, frame: DetectedFrame) -> None:
        if frame.answered is None and self.now is not None:
            frame.answered = self.elapsed(self.now)
            self._silence.answers.append(frame.answered)

    def _count(
        self, counts: CountsByClass, order: int, place: str, key: Mapping[str, float], answered: float | None = None
    ) -> None:
        frame = JudgedFrame(order, place, key, answered, counts.total())
        self._score.add(frame, counts)
        self._silence.frames.append(frame)

    def _take(self, key: FrameKey, number: int, value: Value, side: Callable[[DetectedFrame], Detections]) -> None:
        frame = self._frame(key)
        if frame is not None:
            detections = side(frame)
            detections.add(number, value)
            if detections is frame.found:
                self._answer(frame)
        elif key.time in self._judged and isinstance(value, Box) and side is _found:
            self._score.late += 1

    def _frame(self, key: FrameKey) -> DetectedFrame | None:
        """The frame of a message; None for one that is judged already, or does not count."""
        frame = self._frames.get(key.time)
        if frame is not None or key.time in self._judged or key.time in self._passed_over:
            return frame
        if self.now is None or self.elapsed(self.now) < self._flags["from"]:
            self._pass_over(key)
            return None
        ahead = key.time - self.now  # in lockstep a frame of the step that begins comes before its time
        since = key.time if 0 < ahead <= _OTHER_CLOCK * MICROSECONDS else self.now
        return self._frames.setdefault(key.time, DetectedFrame(key, since))

    def _pass_over(self, key: FrameKey) -> None:
        self._passed_over.add(key.time)
        if self._truth is not None and self._truth.frames != "one":
            self._pictures.discard(self._truth.picture_of(key))

    def _settle(self, due: Callable[[DetectedFrame], bool]) -> None:
        for frame in [frame for frame in self._frames.values() if due(frame)]:
            del self._frames[frame.key.time]
            self._judged.add(frame.key.time)
            self._judge(frame)

    def _judge(self, frame: DetectedFrame) -> None:
        true, found = self._true(frame), frame.found.labelled()
        sampled = self.zero + round(self._time(frame, _DAY) * MICROSECONDS)
        self._score.repeated += frame.found.repeated
        if true is None:
            self._score.without_truth += 1
            shown = [each for each in found if not self._flags["classes"] or each.label in self._flags["classes"]]
            self.judged.frame(sampled, JudgedBoxes((), areas(shown), (), is_known=False))
            return
        counts = compare(found, true, self._flags["iou"], self._flags["classes"])
        self.judged.frame(sampled, counts.boxes)
        order = frame.key.number if self._truth and self._truth.frames == "number" else frame.key.time
        time = self._time(frame)
        key = {"time": time, "sample-time": frame.key.time, "sample-id": frame.key.number}
        self._count(counts, order, f"at {time:.2f} s", key, frame.answered)

    def _time(self, frame: DetectedFrame, farthest: float = _OTHER_CLOCK) -> float:
        """When a frame was sampled, in s; when it came, where its sample time is of another clock, as in recordings."""
        is_near = abs(frame.key.time - frame.since) <= farthest * MICROSECONDS
        return self.elapsed(frame.key.time if is_near else frame.since)

    def _true(self, frame: DetectedFrame) -> Sequence[LabelledBox] | None:
        """The true boxes of a frame; each picture of a file holds for one frame, unless there is one for all."""
        if self._truth is None:
            return frame.true.labelled() if frame.true or frame.has_truth else None
        key = self._truth.picture_of(frame.key)
        if key not in self._pictures:
            return None
        if self._truth.frames != "one":
            self._pictures.remove(key)
            self._last = max(self._last, key)
        return self._truth.pictures[key]
