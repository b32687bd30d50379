"""Found and true boxes of each frame, for the page to compare; boxes are fractions of the picture."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.opendlv import regular_file
from dodo_dsl.plan.model import Plan
from dodo_dsl.report.viewer.encoded import shown
from dodo_dsl.report.viewer.judged import DETECTION, whole
from dodo_dsl.report.viewer.recorded import MICROSECONDS, Channel, RecordedTest
from dodo_dsl.report.viewer.scene import flags_of

_LOGIC = "opendlv.logic.perception.Detection"
_ANNOUNCEMENT = "opendlv.proxy.ImageReadingShm"
_PREFIX = "color:"
_MOST_BOXES = 60_000
_DIGITS = 4

Box = tuple[str, float, float, float, float]
"""Class, left, top, width and height."""
Boxes = dict[int, list[Box]]
"""By the frame's time in us of the test."""


def frames(plan: Plan, folder: Path, test: RecordedTest) -> list[dict[str, Any]]:
    """The frames of the first judge of detections, by time; none without one. ``folder`` is the compiled test's."""
    judge = next((s for s in plan.services if s.judge and s.uses == DETECTION), None)
    if judge is None:
        return []
    flags = flags_of(judge)
    found = _sent(test, whole(flags.get("sender")))
    announced = set(_announced(test, flags))
    times = {*found, *announced}
    if flags.get("truth"):
        pictures = _truth_file(folder / FILES / flags["truth"], flags.get("truth-frames", "one"))
        true = {time: boxes for time in times if (boxes := pictures.get(_picture(time, flags, test))) is not None}
    else:
        is_complete = whole(flags.get("frame-sender")) != whole(flags.get("sender"))  # else the application announces
        empty: Boxes = {time: [] for time in announced} if is_complete else {}
        true = {**empty, **_sent(test, whole(flags.get("truth-sender")))}
    left, rows = _MOST_BOXES, []
    for time in sorted({*times, *true}):
        left -= len(found.get(time, ())) + len(true.get(time, ()))
        if left < 0:
            break
        rows.append({"time": time / MICROSECONDS, "found": found.get(time, []), "true": true.get(time)})
    return rows


def _announced(test: RecordedTest, flags: Mapping[str, str]) -> Iterator[int]:
    channel = test.channel(_ANNOUNCEMENT, whole(flags.get("frame-sender"))) if flags.get("frame-sender") else None
    yield from _micros(channel) if channel else ()


def _micros(channel: Channel) -> list[int]:
    times: list[int] = (channel.times * MICROSECONDS).round().astype(int).tolist()
    return times


def _sent(test: RecordedTest, sender: int) -> Boxes:
    """One sender's boxes, each with its property as class, or else its type; the first of a detectionId counts."""
    labels: dict[tuple[int, int], str] = {}
    for name, field in (("Property", "property"), ("Type", "type")):
        channel = test.channel(_LOGIC + name, sender)
        if channel:
            for key, value in zip(_keys(channel), channel.fields[field], strict=True):
                labels.setdefault(key, _plain(value) if isinstance(value, bytes) else f"type {value}")
    channel = test.channel(_LOGIC + "BoundingBox", sender)
    if channel is None:
        return {}
    boxes: Boxes = {}
    seen = set()
    numbers = (channel.numbers(side).round(_DIGITS).tolist() for side in ("x", "y", "width", "height"))
    for key, *box in zip(_keys(channel), *numbers, strict=True):
        if key not in seen and all(abs(side) < 100 for side in box):
            seen.add(key)
            boxes.setdefault(key[0], []).append((labels.get(key, ""), *box))
    return boxes


def _keys(channel: Channel) -> list[tuple[int, int]]:
    """Time and detectionId of each message."""
    numbers: list[int] = channel.numbers("detectionId").astype(int).tolist()
    return list(zip(_micros(channel), numbers, strict=True))


def _plain(value: object) -> str:
    text = value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
    return shown(text.strip().removeprefix(_PREFIX).strip(), 60)


def _picture(time: int, flags: Mapping[str, str], test: RecordedTest) -> int:
    """The picture of a frame in a truth file."""
    kind = flags.get("truth-frames", "one")
    if kind == "sample-time":
        return time + test.begin
    if kind == "number":
        return _sample_ids(test, whole(flags.get("sender"))).get(time, -1)
    return 0


def _sample_ids(test: RecordedTest, sender: int) -> dict[int, int]:
    channel = test.channel(_LOGIC + "BoundingBox", sender)
    if channel is None:
        return {}
    numbers: list[int] = channel.numbers("sampleId").astype(int).tolist()
    return dict(zip(_micros(channel), numbers, strict=True))


def _truth_file(path: Path, kind: str) -> dict[int, list[Box]]:
    """The boxes of a COCO file by picture; none of what cannot be read: its service reports that."""
    try:
        document = json.loads(regular_file.text(path))
        names = {entry["id"]: _plain(entry["name"]) for entry in document["categories"]}
        sizes = {entry["id"]: (entry["width"], entry["height"]) for entry in document["images"]}
        fields = {"number": "id", "sample-time": "sample_time"}
        keys = {entry["id"]: entry[fields[kind]] if kind in fields else 0 for entry in document["images"]}
        boxes: dict[int, list[Box]] = {key: [] for key in keys.values()}
        for entry in document["annotations"]:
            (wide, high), (x, y, width, height) = sizes[entry["image_id"]], entry["bbox"]
            left, top, across, down = (
                round(part, _DIGITS) for part in (x / wide, y / high, width / wide, height / high)
            )
            boxes[keys[entry["image_id"]]].append((names[entry["category_id"]], left, top, across, down))
    except (OSError, ValueError, TypeError, KeyError, ZeroDivisionError, RecursionError):
        return {}
    return boxes
