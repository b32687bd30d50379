"""The verdict on a perception in one sentence."""

from collections.abc import Sequence

from services.base import Check, Verdict
from services.object_detection.score import MEASURES, DetectionLimits, Score


def verdict(score: Score, limits: DetectionLimits, during: str) -> Verdict:
    """Passed when every limit is kept; ``during`` is the observed time in words."""
    checks = score.checks(limits)
    if not score.answered:
        return Verdict("failed", _silence(score, during), checks)
    broken = [check for check in checks if not check.ok]
    if broken:
        faults = [_fault(check, score) for check in _telling(broken, [label for label, _ in score.counts])]
        return Verdict("failed", "; ".join(faults) + _kinds(score) + _worst(score) + _aside(score), checks)
    total = score.counts.total()
    kept = ", ".join(
        f"{check.name} {_number(check)} ({_bound(check)})" for check in checks[: len(MEASURES)] if check.limit
    )
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
    bound = _bound(check)
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
        return f"{name} has no value ({bound}), as {_nothing(measure)}"
    counts = dict(score.counts)["" if label == "unnamed" else label] if label else score.counts.total()
    wrong = {"precision": _count(counts.false, "false detection"), "recall": f"{counts.missed} missed"}
    both = f"{wrong['precision']} and {wrong['recall']}"
    return f"{name} is {_number(check)} ({bound}), with {wrong.get(measure, both)} beside {counts.hits} found"


def _unanswered(check: Check, score: Score) -> str:
    """How many, and where the longest run is."""
    count, frames, longest = score.unanswered.silent, score.unanswered.frames, score.unanswered.longest
    said = f"{count} of {_count(frames, 'frame')} had no answer, a share of {_number(check)} ({_bound(check)})"
    first, last = (frame.place.partition(" ")[2] for frame in (longest[0], longest[-1]))
    if len(longest) == 1:
        return f"{said}, such as the one {longest[0].place}"
    return f"{said}, the longest run is {len(longest)} frames, from {first} to {last}"


def _nothing(measure: str) -> str:
    return {"precision": "nothing was detected", "recall": "there was nothing to detect"}.get(
        measure, "there was nothing"
    )


def _kinds(score: Score) -> str:
    sentence = score.counts.mistakes.sentence
    return f"; {sentence}" if sentence else ""


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


def _bound(check: Check) -> str:
    side, limit = next(iter(check.limit.items()))
    return f"at {'most' if side == 'max' else 'least'} {limit:.4g}"


def _number(check: Check) -> str:
    """In full where rounding would hide that it broke its limit."""
    short = f"{check.value:.4g}"
    bound = f"{next(iter(check.limit.values())):.4g}"
    return str(check.value) if not check.ok and short == bound else short


def _count(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
