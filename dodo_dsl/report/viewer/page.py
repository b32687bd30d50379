"""A test's page: the data of its drive, the lines of the spec that set each limit, and what all pages share."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dodo_dsl import atomic, package_data
from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.assets import map_file
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.odvd import OdvdError
from dodo_dsl.outcome import (
    PEAK_MEMORY,
    PROCESSOR_SHARE,
    PROCESSOR_TIME,
    SAMPLE_TIMES,
    SLOW_ANSWERS,
    Outcome,
)
from dodo_dsl.plan.added_services import RECORDING
from dodo_dsl.plan.model import Place, Plan, PlannedService
from dodo_dsl.report import checks as words
from dodo_dsl.report import trajectory
from dodo_dsl.report.files import DATA, LOGS, PAGE, SHARED, TRAJECTORY
from dodo_dsl.report.trajectory import Ground, Way, colour_of, ground_of
from dodo_dsl.report.viewer import log_lines, moment, pictures, recorded
from dodo_dsl.report.viewer.encoded import packed, script, shown
from dodo_dsl.report.viewer.judged import read
from dodo_dsl.report.viewer.pictures import Replayed
from dodo_dsl.report.viewer.recorded import FRAME, Channel, RecordedTest
from dodo_dsl.report.viewer.units import title_of, unit_of

_OF_THE_TEST = {
    SLOW_ANSWERS: ("response", "max"),
    SAMPLE_TIMES: ("response", "sample-times"),
    PEAK_MEMORY: ("resources", "max-memory"),
    PROCESSOR_TIME: ("resources", "max-processor-time"),
    PROCESSOR_SHARE: ("resources", "max-processor-share"),
}
"""Checks of no evaluator, some with the name of a service behind theirs, and where the test asks for them."""
_MOST_SPEC = 1 << 20

Parameters = Mapping[str, Mapping[str, tuple[str, ...]]]
"""What sets the limits of checks: names of parameters by the evaluator's name and the check's, as they recorded it."""


def spec_lines(name: str, roots: Sequence[Path] = ()) -> list[str]:
    """The lines of a spec as far as its file can be read from here; else none."""
    for root in roots or (Path.cwd(), package_data.root(), package_data.registry()):
        path = root / name
        try:
            if path.resolve().is_relative_to(root.resolve()):
                return [shown(line) for line in regular_file.text(path, _MOST_SPEC).splitlines()]
        except (OSError, ValueError):
            continue
    return []


def checks(plan: Plan, outcome: Outcome, recorded: Parameters, roots: Sequence[Path] = ()) -> Iterator[dict[str, Any]]:
    """All checks, each with the places of its limit: the parameter's, or the service's where it is set by default."""
    names, files = [check["name"] for check in outcome.checks], dict[str, list[str]]()
    for check in outcome.checks:
        places = list(limit_places(plan, check["name"], recorded)) if check.get("limit") else []
        files |= {place.file: spec_lines(place.file, roots) for _, place in places if place.file not in files}
        yield {
            "name": shown(check["name"], 100),
            "value": shown(words.measured(check), 80),
            "limits": [shown(limit, 80) for limit in words.limits(check)],
            "ok": bool(check["ok"]),
            "follows": words.only_follows(check, outcome.checks),
            "meaning": shown(words.meaning(check, names), 200),
            "bar": words.bar_place(check),
            "places": [
                {
                    "file": shown(place.file, 400),
                    "line": place.line,
                    "text": "".join(files[place.file][place.line - 1 : place.line]).strip(),
                    "isDefault": not flag,
                }
                for place, flag in {place: flag for flag, place in places}.items()
            ],
        }


def limit_places(plan: Plan, check: str, recorded: Parameters) -> Iterator[tuple[str, Place]]:
    """Where the spec sets the limit of a check, each with the parameter's name, empty for a service's default."""
    for name, (section, flag) in _OF_THE_TEST.items():
        if f"{check}-".startswith(f"{name}-") and section in plan.source_map:
            yield flag, plan.source_map[section]
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


VERSION = 5
_MOST = 20_000
"""Points and lines of a map that are drawn."""


def write_shared(report: Path) -> None:
    """What all pages of a report use; raises OSError. Nothing is written through a symlink."""
    if (report / SHARED).is_symlink():
        (report / SHARED).unlink()
    for source in sorted(_sources().iterdir()):
        if source.name != PAGE:
            atomic.write_bytes(report / SHARED / source.name, source.read_bytes())


def write(folder: Path, outcome: Outcome, plan: Plan, compiled: Path) -> None:
    """The page of a test in its folder of the report; ``compiled`` is the compiled test's. Raises OSError."""
    messages = _messages(plan, compiled)
    recording = folder / RECORDING
    test = recorded.read(recording, messages) if recording.is_file() else RecordedTest()
    record = read(plan, folder / LOGS)
    ground, way = ground_of(plan, compiled), record.way or Way()
    path = _path(test, way.frame)
    if len(path):
        trajectory.draw(folder / TRAJECTORY, ground, way, path, outcome.outcome)
    decisive = moment.decisive(outcome, test.duration)
    videos = list(pictures.write(folder, list(_replayed(plan, compiled)), test, messages))
    for video in videos[:1]:
        pictures.write_frame(folder, video, decisive.time)
    if outcome.level != "hil":
        pictures.shrink_snapshot(folder)
    document = {
        "version": VERSION,
        "test": _facts(outcome),
        "spec": "\n".join(spec_lines(outcome.spec)),
        "files": [path.name for path in sorted(folder.glob("*.rec"))],
        "duration": test.duration,
        "moment": dataclasses.asdict(decisive),
        "checks": list(checks(plan, outcome, record.parameters)),
        "scene": scene(ground, way),
        "log": log_lines.merged(folder / LOGS, test),
        "channels": [_channel(channel) for channel in test.channels],
        "frames": record.frames(test.begin),
        "videos": [dataclasses.asdict(video) for video in videos],
        "judged": record.series(test.begin),
        "messages": record.messages,
        "why": record.why() if test.channels else "",
    }
    atomic.write_text(folder / DATA, script(document))
    write_html(folder)


def write_html(folder: Path) -> None:
    """The page alone: the same for all tests. Raises OSError."""
    atomic.write_bytes(folder / PAGE, (_sources() / PAGE).read_bytes())


def _path(test: RecordedTest, sender: int) -> trajectory.Points:
    """Where the vehicle was, in m; nothing without positions."""
    frames = [channel for channel in test.channels if channel.message == FRAME]
    for channel in [*(c for c in frames if c.sender == sender), *frames]:
        path = np.stack([channel.numbers("x"), channel.numbers("y")], axis=1)
        if len(path := path[np.isfinite(path).all(axis=1)]):
            return path
    return np.empty((0, 2))


def _replayed(plan: Plan, compiled: Path) -> Iterator[Replayed]:
    """The recordings whose frames a test plays."""
    for service in plan.services:
        flags = {flag.name: flag.value for flag in service.flags}
        if "video-sender" in flags or service.uses == "rec-replay":
            begin, end = float(flags.get("start", 0)), float(flags.get("end", "inf"))
            yield Replayed(compiled / FILES / flags["rec"], int(flags.get("video-sender", 0)), begin, end)


def scene(ground: Ground, way: Way) -> dict[str, Any]:
    """The map under the test's path, as its judges see it."""
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
        "title": shown(words.title(outcome)),
        "notes": [shown(note) for note in outcome.notes],
        "lastLines": [shown(line) for line in outcome.last_lines],
        "seed": outcome.seed,
    }


def _channel(channel: Channel) -> dict[str, Any]:
    of = f" of {channel.message.rpartition('.')[2]}{f'/{channel.sender}' if channel.sender else ''}"
    numbers = {name: values for name, values in channel.fields.items() if not isinstance(values, list)}
    return {
        "message": channel.message,
        "sender": channel.sender,
        "every": channel.every,
        "times": packed(channel.times),
        "fields": [
            {
                "name": name,
                "title": title_of(f"{name}{of}"),
                "unit": unit_of(f"{name}{of}"),
                "values": packed(values),
            }
            for name, values in numbers.items()
        ],
    }
