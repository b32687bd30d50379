"""A test's page: the data of its drive beside it, and what all pages of a report share."""

import dataclasses
from pathlib import Path
from typing import Any

from dodo_dsl import atomic, package_data
from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.odvd.tokens import OdvdError
from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.model import Plan
from dodo_dsl.plan.recorder_service import PICTURES_FILE, RECORDING
from dodo_dsl.report.pictures.trajectory import Way, ground_of
from dodo_dsl.report.viewer import judged, limits, log_lines, moment, pictures, recorded
from dodo_dsl.report.viewer.encoded import packed, script, shown
from dodo_dsl.report.viewer.names import BEFORE, DATA, LOGS, PAGE, SHARED
from dodo_dsl.report.viewer.recorded import Channel, RecordedTest

VERSION = 3
FRAME = "opendlv.sim.Frame"
_MOST = 20_000
"""Points and lines of a map that are drawn."""
_WITHOUT_RECORDS = 2
"""A version whose evaluators recorded nothing: the report itself worked out what they judged."""
_OF_BEFORE_RECORDS = "Evaluators of the DoDo that made this report did not record what they judged over time."
_OF_BEFORE = f'<script defer src="{BEFORE}"></script>\n'


def write_shared(report: Path) -> None:
    """What all pages of a report use; raises OSError. Nothing is written through a symlink."""
    if (report / SHARED).is_symlink():
        (report / SHARED).unlink()
    for source in sorted(_sources().iterdir()):
        if source.name != PAGE:
            atomic.write_bytes(report / SHARED / source.name, source.read_bytes())


def write(folder: Path, outcome: Outcome, plan: Plan, compiled: Path) -> None:
    """The page of a test in its folder of the report; ``compiled`` is the compiled test's. Raises OSError."""
    atomic.write_text(folder / DATA, script(document(folder, outcome, plan, compiled)))
    write_html(folder)


def write_html(folder: Path) -> None:
    """The page alone: the same for all tests, but for whether there is a way to compare with. Raises OSError."""
    text = (_sources() / PAGE).read_text(encoding="utf-8")
    if not (folder / BEFORE).is_file():
        text = text.replace(_OF_BEFORE, "")
    atomic.write_text(folder / PAGE, text)


def document(folder: Path, outcome: Outcome, plan: Plan, compiled: Path) -> dict[str, Any]:
    """All that the page shows, as a JSON value whose keys are fixed."""
    messages = _messages(plan, compiled)
    recording = folder / RECORDING
    test = recorded.read(recording, messages) if recording.is_file() else RecordedTest()
    record = judged.read(plan, folder / LOGS)
    return {
        "version": VERSION,
        "test": _facts(outcome),
        "duration": test.duration,
        "isRecorded": bool(test.channels),
        "moment": dataclasses.asdict(moment.decisive(outcome, test.duration)),
        "checks": list(limits.checks(plan, outcome, limits.SpecLines(), record.parameters)),
        "scene": scene(plan, compiled, record.way or Way()),
        "log": log_lines.merged(folder / LOGS, test),
        "channels": [_channel(channel) for channel in test.channels],
        "frames": record.frames(test.begin),
        "videos": _videos(folder, test, messages),
        "judged": record.series(test.begin),
        "messages": record.messages,
        "why": record.why() if test.channels else "",
    }


def of_today(document: dict[str, Any]) -> dict[str, Any]:
    """What a page of an earlier version holds, as one of today's: without limits where no evaluator recorded them."""
    if document["version"] != _WITHOUT_RECORDS:
        return document
    nothing = {"version": VERSION, "frames": [], "judged": [], "messages": []}
    return {**document, **nothing, "why": f"{_OF_BEFORE_RECORDS} No limits, targets and boxes are drawn."}


def scene(plan: Plan, folder: Path, way: Way) -> dict[str, Any]:
    """The map under the test's path, as its judges see it; ``folder`` is the compiled test's."""
    ground = ground_of(plan, folder)
    return {
        "models": [{"colour": list(colour), "points": points[:_MOST]} for colour, points in ground.models],
        "lines": [
            {"name": shown(name, 80), "role": way.roles.get(name, "other"), "lines": lines[:_MOST]}
            for name, lines in ground.lines
        ],
        "length": way.length,
        "width": way.width,
        "frame": {"message": FRAME, "sender": way.frame},
    }


def _sources() -> Path:
    return package_data.templates() / "viewer"


def _messages(plan: Plan, compiled: Path) -> MessageSet:
    try:
        return MessageSet.load(*(compiled / FILES / path for path in plan.messages))
    except OdvdError:
        return MessageSet.standard()


def _facts(outcome: Outcome) -> dict[str, Any]:
    texts = ("name", "slug", "level", "kind", "outcome", "reason", "description", "clock", "backend", "spec")
    return {
        **{name: shown(getattr(outcome, name)) for name in texts},
        "notes": [shown(note) for note in outcome.notes],
        "lastLines": [shown(line) for line in outcome.last_lines],
        "seed": outcome.seed,
    }


def _videos(folder: Path, test: RecordedTest, messages: MessageSet) -> list[dict[str, Any]]:
    found = pictures.write(folder, [folder / RECORDING, folder / PICTURES_FILE], test, messages)
    return [{"problem": each} if isinstance(each, str) else dataclasses.asdict(each) for each in found]


def _channel(channel: Channel) -> dict[str, Any]:
    numbers = {name: values for name, values in channel.fields.items() if not isinstance(values, list)}
    return {
        "message": channel.message,
        "sender": channel.sender,
        "every": channel.every,
        "times": packed(channel.times),
        "fields": [{"name": name, "values": packed(values)} for name, values in numbers.items()],
    }
