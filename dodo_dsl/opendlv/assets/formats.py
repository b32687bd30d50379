"""The formats of files that parameters name: each a function that yields what is wrong with a file.

Readers are imported where they are needed, as few tests need all of them.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.assets import map_file, mesh_text, recording_contents
from dodo_dsl.opendlv.assets.json_file import read_bytes, unread
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.picture_size import problem_of

Settings = Mapping[str, str]
"""What the test gives to other parameters of the service, as text; empty if there is no value."""
Ids = Mapping[str, int]
"""The numbers of messages, by name."""

RECORDING = ".rec"
PICTURES = (".png", ".jpg", ".jpeg")


def problems(name: str, path: Path, settings: Settings, ids: Ids) -> Iterator[InputError]:
    """What is wrong with a file of a format; nothing where the services of DoDo do not read it."""
    try:
        yield from FORMATS[name].problems(path, settings, ids)
    except InputError as error:
        yield error


def _map(path: Path, _settings: Settings, _ids: Ids) -> Iterator[InputError]:
    read, found = map_file.problems(path)
    yield from found
    if read is None:
        return
    paints: list[Any] = [each.paint for each in (*read.models, *read.blocks)]
    paints += [overlay.texture_file for overlay in read.overlays]
    for file, is_plain in dict.fromkeys((model.file, model.paint is None) for model in read.models):
        try:
            mesh = mesh_text.read(file)
            paints += [p for p, _ in mesh_text.paints(file, mesh, read.path.parent)] if is_plain else ()
        except InputError as error:
            yield error
    for paint in dict.fromkeys(paint for paint in paints if isinstance(paint, Path)):
        try:
            _refuse_bad_picture(paint)
        except InputError as error:
            yield error


def _refuse_bad_picture(file: Path) -> None:
    if problem := problem_of(read_bytes(file)):
        raise InputError(file, problem, hint="save the image again as PNG or JPEG")


def _obstacles(path: Path, settings: Settings, _ids: Ids) -> Iterator[InputError]:
    file = map_file.find_map(path)
    if settings.get("bodies") == "true" and not {*map(str, map_file.read_frames(path))} - {settings["frame-id"]}:
        yield InputError(file, map_file.NO_BODIES, hint='give the model of another vehicle "frames": [1]')
    map_file.read_obstacles(path)
    yield from unread(file, map_file.document_of(file), map_file.LISTS)


def _truth(path: Path, settings: Settings, _ids: Ids) -> Iterator[InputError]:
    from dodo_dsl.opendlv.assets import truth_file

    frames: truth_file.Frames = settings["truth-frames"]  # type: ignore[assignment]
    pictures = truth_file.read(path, frames)
    labels, known = {label for boxes in pictures.values() for label, _ in boxes}, truth_file.categories(path)
    for name in settings["classes"].split(","):
        if name in known and name not in labels:  # others are reported by the rule on names
            yield InputError(path, truth_file.no_box(name, labels), "$.annotations")


def _target(path: Path, settings: Settings, ids: Ids) -> Iterator[InputError]:
    if path.suffix != RECORDING:
        from dodo_dsl.opendlv.assets import table

        table.read_target(path, settings["target-field"] or settings["field"])
        return
    message = settings["target-message"] or settings["message"]
    sender = settings["target-sender"] or settings["sender"]
    if message in ids and sender.isdecimal():
        yield from recording_contents.problems(path, ids[message], int(sender), message, is_needed=True)


def _way_points(path: Path, settings: Settings, _ids: Ids) -> Iterator[InputError]:
    from dodo_dsl.opendlv.assets.trajectory import Trajectory, TrajectoryError, read_table

    try:
        Trajectory(read_table(path, 0.0), float(settings["speed"] or 1))
    except TrajectoryError as error:
        yield InputError(path, error.what, line=error.line)


def _car(path: Path, _settings: Settings, _ids: Ids) -> Iterator[InputError]:
    from dodo_dsl.opendlv.assets import car

    car.read_car(path)
    yield from ()


def _recording(path: Path, settings: Settings, _ids: Ids) -> Iterator[InputError]:
    sender = settings.get("video-sender", "") if settings.get("video") == "true" else ""
    wanted = (IMAGE, int(sender)) if sender.isdecimal() else (-1, 0)
    yield from recording_contents.problems(path, *wanted, "pictures", is_needed=False)


def _pictures(path: Path, _settings: Settings, ids: Ids) -> Iterator[InputError]:
    if path.suffix == RECORDING:
        yield from _recording(path, {}, ids)
    elif path.suffix.lower() in PICTURES:
        _refuse_bad_picture(path)


class Format(NamedTuple):
    """A check, the parameters that say how a file is read, and where to read on for problems without their own hint.

    The check yields what is wrong, and may end with an InputError.
    """

    problems: Callable[[Path, Settings, Ids], Iterator[InputError]]
    settings: tuple[str, ...] = ()
    help: str = ""


_MAPS = "docs/reference/maps.md has an example"
_OF_TARGETS = ("field", "message", "sender", "target-field", "target-message", "target-sender")
FORMATS: Mapping[str, Format] = {
    "map": Format(_map, (), _MAPS),
    "obstacles": Format(_obstacles, ("bodies", "frame-id"), _MAPS),
    "truth": Format(_truth, ("truth-frames", "classes"), "services/object_detection/README.md shows what a truth has"),
    "target": Format(_target, _OF_TARGETS, "services/continuous_signal/README.md shows what a target has"),
    "way-points": Format(_way_points, ("speed",), "services/beacon/README.md shows what a path has"),
    "car": Format(_car, (), "services/dynamic_model/README.md lists the parameters"),
    "recording": Format(_recording, ("video", "video-sender")),
    "pictures": Format(_pictures),
}
