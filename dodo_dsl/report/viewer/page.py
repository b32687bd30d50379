"""A test's page: the data of its drive, the lines of the spec that set each limit, and what all pages share."""

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from dodo_dsl import atomic, package_data
from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.assets import map_file
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.odvd import OdvdError
from dodo_dsl.outcome import (
    MEMORY_GROWTH,
    PEAK_MEMORY,
    PROCESSOR_SHARE,
    PROCESSOR_TIME,
    SAMPLE_TIMES,
    SLOW_ANSWERS,
    Outcome,
)
from dodo_dsl.plan.added_services import PICTURES_FILE, RECORDING
from dodo_dsl.plan.model import Place, Plan, PlannedService
from dodo_dsl.report import comparison
from dodo_dsl.report.check_display import meaning
from dodo_dsl.report.check_display import place as bar_place
from dodo_dsl.report.trajectory import Ground, Way, colour_of, ground_of
from dodo_dsl.report.viewer import log_lines, moment, pictures, recorded
from dodo_dsl.report.viewer.encoded import packed, script, shown
from dodo_dsl.report.viewer.names import BEFORE, DATA, LOGS, PAGE, SHARED
from dodo_dsl.report.viewer.record import read
from dodo_dsl.report.viewer.recorded import Channel, RecordedTest

_OF_THE_TEST = {SLOW_ANSWERS: "max", SAMPLE_TIMES: "sample-times"}
"""Checks of no evaluator, and the key of the test's ``response`` that asks for them."""
_OF_USE = {
    PEAK_MEMORY: "max-memory",
    MEMORY_GROWTH: "max-memory-growth",
    PROCESSOR_TIME: "max-processor-time",
    PROCESSOR_SHARE: "max-processor-share",
}
"""The same of the test's ``resources``; the name of a service follows that of the check."""
_MOST_SPEC = 1 << 20

Parameters = Mapping[str, Mapping[str, tuple[str, ...]]]
"""What sets the limits of checks: names of parameters by the evaluator's name and the check's, as they recorded it."""


class SpecLines:
    """Lines of specs by their places, as far as the files can be read from here."""

    def __init__(self, roots: tuple[Path, ...] = ()) -> None:
        self._roots = roots or (Path.cwd(), package_data.root(), package_data.registry())
        self._files: dict[str, list[str]] = {}

    def line(self, place: Place) -> str:
        """The line without its indent; empty if there is no such file any more."""
        if place.file not in self._files:
            self._files[place.file] = self._read(place.file)
        lines = self._files[place.file]
        return shown(lines[place.line - 1].strip(), 400) if 0 < place.line <= len(lines) else ""

    def _read(self, name: str) -> list[str]:
        for root in self._roots:
            path = root / name
            try:
                if path.resolve().is_relative_to(root.resolve()):
                    return regular_file.text(path, _MOST_SPEC).splitlines()
            except (OSError, ValueError):
                continue
        return []


def checks(plan: Plan, outcome: Outcome, lines: SpecLines, recorded: Parameters) -> Iterator[dict[str, Any]]:
    """All checks, each with the places of its limit: the parameter's, or the service's where it is set by default."""
    names = {check["name"] for check in outcome.checks}
    for check in outcome.checks:
        places = list(limit_places(plan, check["name"], recorded)) if check.get("limit") else []
        yield {
            "name": shown(check["name"], 100),
            "value": check["value"],
            "limits": [shown(words, 80) for words in comparison.limits(check)],
            "unit": shown(check.get("unit") or "", 40),
            "ok": bool(check["ok"]),
            "follows": comparison.only_follows(check, outcome.checks),
            "margin": check.get("margin"),
            "meaning": shown(meaning(check, names), 200),
            "bar": bar_place(check),
            "places": [
                {"file": shown(place.file, 400), "line": place.line, "text": lines.line(place), "flag": flag}
                for flag, place in places
            ],
        }


def limit_places(plan: Plan, check: str, recorded: Parameters) -> Iterator[tuple[str, Place]]:
    """Where the spec sets the limit of a check, each with the parameter's name, empty for a service's default."""
    if check in _OF_THE_TEST and "response" in plan.source_map:
        yield _OF_THE_TEST[check], plan.source_map["response"]
    for name, flag in _OF_USE.items():
        if check.startswith(f"{name}-") and "resources" in plan.source_map:
            yield flag, plan.source_map["resources"]
    for service in plan.services:
        if not service.judge:
            continue
        key, names = f"{service.layer}.{service.name}", _parameters(service, check, recorded)
        found = [(name, plan.source_map[f"{key}.{name}"]) for name in names if f"{key}.{name}" in plan.source_map]
        if found:
            yield from found
        elif names and key in plan.source_map:
            yield "", plan.source_map[key]


def _parameters(service: PlannedService, check: str, recorded: Parameters) -> list[str]:
    """The parameters of a judge that set the limit of a check: those that it recorded, else by their names."""
    named = recorded.get(service.name, {}).get(check, (f"max-{check}", f"min-{check}", check))
    own = {flag.name for flag in service.flags}
    return [name for name in named if name in own]


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
    record = read(plan, folder / LOGS)
    return {
        "version": VERSION,
        "test": _facts(outcome),
        "duration": test.duration,
        "moment": dataclasses.asdict(moment.decisive(outcome, test.duration)),
        "checks": list(checks(plan, outcome, SpecLines(), record.parameters)),
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
        "bodies": list(_bodies(ground, way.frame)),
        "length": way.length,
        "width": way.width,
        "frame": {"message": FRAME, "sender": way.frame},
    }


def _bodies(ground: Ground, own: int) -> Iterator[dict[str, Any]]:
    """Other vehicles: each stamp's model from above, in m about its place and along its heading."""
    for stamp, (name, model) in map_file.bodies(ground.moving, own).items():
        try:
            outline = model.footprint()
        except InputError:
            continue  # reported by the service that draws it
        yield {"name": shown(name, 80), "sender": stamp, "colour": list(colour_of(model)), "outline": outline[:_MOST]}


def _sources() -> Path:
    return package_data.templates() / "viewer"


def _messages(plan: Plan, compiled: Path) -> MessageSet:
    try:
        return MessageSet.load(*(compiled / FILES / path for path in plan.messages), kept=MessageSet.standard().names())
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
