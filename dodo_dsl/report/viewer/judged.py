"""What the evaluators of a test looked at, as the page draws it; which they are, their names in the Plan say."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.plan.model import Plan, PlannedService
from dodo_dsl.report import check_words
from dodo_dsl.report.viewer import target
from dodo_dsl.report.viewer.encoded import packed, shown
from dodo_dsl.report.viewer.recorded import RecordedTest
from dodo_dsl.report.viewer.scene import flags_of

SIGNAL, TRACK, DETECTION = "continuous-signal", "collision", "object-detection"
_RECORDING = ".rec"
_MOST = 200_000
"""Samples of a target that are drawn."""

Key = tuple[str, int]
"""Message and sender stamp."""


def channels(plan: Plan) -> set[Key]:
    """The channels of which every sample is judged."""
    found = set()
    for service in plan.services:
        flags = flags_of(service)
        if service.judge and service.uses == SIGNAL:
            found.add((flags.get("message", ""), whole(flags.get("sender"))))
    return found


def judged(plan: Plan, folder: Path, test: RecordedTest, messages: MessageSet) -> Iterator[dict[str, Any]]:
    """One description for each plot; ``folder`` is the compiled test's."""
    for service in plan.services:
        if not service.judge:
            continue
        flags = flags_of(service)
        if service.uses == SIGNAL:
            yield _signal(service, flags, folder, test, messages)
        elif service.uses == TRACK:
            yield from _track(service, flags)
        elif service.uses == DETECTION:
            yield _detection(service, flags, folder)


def whole(text: str | None) -> int:
    """A number that a flag gives, 0 where it gives none."""
    return int(text) if text and text.isdecimal() else 0


def number(text: str | None) -> float | None:
    try:
        return float(text) if text else None
    except ValueError:
        return None


def _signal(
    service: PlannedService, flags: Mapping[str, str], folder: Path, test: RecordedTest, messages: MessageSet
) -> dict[str, Any]:
    problem = ""
    try:
        times, values = _target(flags, folder, test, messages)
    except (OSError, ValueError, IndexError) as error:
        times, values = target.EMPTY
        problem = shown(f"its target is not shown: {getattr(error, 'strerror', None) or error}", 200)
    return {
        "kind": "signal",
        "evaluator": service.name,
        "message": flags.get("message", ""),
        "sender": whole(flags.get("sender")),
        "field": flags.get("field", ""),
        "target": {"times": packed(times[:_MOST]), "values": packed(values[:_MOST])},
        "band": number(flags.get("band")),
        "distance": (distance := number(flags.get("max-distance"))),
        "limit": "" if distance is None else f"distance {check_words.bound('max', distance)}",
        "from": number(flags.get("from")),
        "until": number(flags.get("until")),
        "problem": problem,
    }


def _target(flags: Mapping[str, str], folder: Path, test: RecordedTest, messages: MessageSet) -> target.Samples:
    message = flags.get("target-message") or flags.get("message", "")
    sender = whole(flags.get("target-sender") or flags.get("sender"))
    field = flags.get("target-field") or flags.get("field", "")
    if not flags.get("target"):
        return target.from_channel(test, message, sender, field)
    path, is_sample_time = folder / FILES / flags["target"], flags.get("align") == "sample-time"
    if path.suffix == _RECORDING:
        return target.from_recording(path, message, sender, field, messages, test, is_sample_time)
    return target.from_table(path, field, is_sample_time, test.begin)


def _track(service: PlannedService, flags: Mapping[str, str]) -> Iterator[dict[str, Any]]:
    if flags.get("walls"):
        least = number(flags.get("min-margin"))
        limit = check_words.bound("min", least or 0.0, "m", exclusive=not least)
        yield {"kind": "margin", "evaluator": service.name, "min": least, "limit": limit}
    most = number(flags.get("max-speed"))
    limit = "" if most is None else check_words.bound("max", most, "m/s")
    yield {"kind": "speed", "evaluator": service.name, "max": most, "limit": limit}
    for request in filter(None, flags.get("requests", "").split(",")):
        message, _, sender = request.partition("/")
        yield {"kind": "request", "evaluator": service.name, "message": shown(message, 100), "sender": whole(sender)}


def _detection(service: PlannedService, flags: Mapping[str, str], folder: Path) -> dict[str, Any]:
    return {
        "kind": "detection",
        "evaluator": service.name,
        "iou": number(flags.get("iou")),
        "classes": [shown(name, 100) for name in flags.get("classes", "").split(",") if name],
    }
