"""The formats of files that parameters name: each a function that yields what is wrong with a file.

Readers are imported where they are needed, as few tests need all of them.
"""

import os
import shlex
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.assets import map_file, mesh_text
from dodo_dsl.opendlv.assets.json_file import read_bytes
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.picture_size import problem_of

Settings = Mapping[str, str]
"""What the test gives to other parameters of the service, as text; empty if there is no value."""
Ids = Mapping[str, int]
"""The numbers of messages, by name."""
Format = Callable[[Path, Settings, Ids], Iterator[InputError]]

RECORDING = ".rec"
PICTURES = (".png", ".jpg", ".jpeg")
_BOXES = "$.annotations"
_IMAGE_NAME = "pictures"
_POINTER = b"version https://git-lfs"


def problems(name: str, path: Path, settings: Settings, ids: Ids) -> Iterator[InputError]:
    """What is wrong with a file of a format; nothing where the services of DoDo do not read it."""
    yield from _pointer(map_file.find_map(path)) or _FORMATS[name](path, settings, ids)


def _pointer(path: Path) -> list[InputError]:
    """The problem of a file whose content is elsewhere, in Git LFS."""
    try:
        with regular_file.opened(path) as file:
            is_pointer = file.read(len(_POINTER)) == _POINTER
    except OSError:
        return []
    return [InputError(path, "a Git LFS pointer, not the file", hint=f"run: {_lfs(path)}")] if is_pointer else []


def _lfs(path: Path) -> str:
    """What fetches a file, in the folder where the command is typed."""
    folder = path.resolve().parent
    below = os.path.relpath(folder) if folder.is_relative_to(Path.cwd()) else str(folder)
    return "git lfs pull" if below == "." else f"git -C {shlex.quote(below)} lfs pull"


def _map(path: Path, _settings: Settings, _ids: Ids) -> Iterator[InputError]:
    read, found = map_file.problems(path)
    yield from found
    if read is None:
        return
    paints = [*(model.paint for model in read.models), *(block.paint for block in read.blocks)]
    for file, is_plain in dict.fromkeys((model.file, model.paint is None) for model in read.models):
        try:
            pointer = _pointer(file)
            yield from pointer
            if not pointer:
                mesh = mesh_text.read(file)
                paints += [p for p, _ in mesh_text.paints(file, mesh, read.path.parent)] if is_plain else ()
        except InputError as error:
            yield error
    for paint in dict.fromkeys((*paints, *(overlay.texture_file for overlay in read.overlays))):
        if isinstance(paint, Path):
            yield from _picture(paint)


def _picture(file: Path) -> Iterator[InputError]:
    pointer = _pointer(file)
    yield from pointer
    try:
        problem = problem_of(read_bytes(file))
    except InputError as error:
        yield error
    else:
        if problem and not pointer:
            yield InputError(file, problem, hint="save the image again as PNG or JPEG")


def _obstacles(path: Path, settings: Settings, _ids: Ids) -> Iterator[InputError]:
    file = map_file.find_map(path)
    if settings.get("bodies") == "true" and not {*map(str, map_file.read_frames(path))} - {settings["frame-id"]}:
        yield InputError(file, map_file.NO_BODIES, hint='give the model of another vehicle "frames": [1]')
    if found := _raised(lambda: map_file.read_obstacles(path)):
        yield from found
    else:
        yield from map_file.unread_keys(file, map_file.document_of(file))


def _truth(path: Path, settings: Settings, _ids: Ids) -> Iterator[InputError]:
    from dodo_dsl.opendlv.assets import truth_file

    frames: truth_file.Frames = settings["truth-frames"]  # type: ignore[assignment]
    try:
        pictures = truth_file.read(path, frames)
    except truth_file.NoBoxes:
        return  # reported by the rule on empty files
    except InputError as error:
        yield error
        return
    yield from truth_file.corners(path)
    labels = {label for boxes in pictures.values() for label, _ in boxes}
    missing = [name for name in settings["classes"].split(",") if name and name not in labels]
    known = truth_file.categories(path) if missing else ()
    for name in missing:
        if name in known:  # others are reported by the rule on names
            yield InputError(path, truth_file.no_box(name, labels), _BOXES)


def _target(path: Path, settings: Settings, ids: Ids) -> Iterator[InputError]:
    field = settings["target-field"] or settings["field"]
    if path.suffix != RECORDING:
        from dodo_dsl.opendlv.assets import table

        yield from _raised(lambda: table.read_target(path, field)) or table.misspelt(path, field)
        return
    message = settings["target-message"] or settings["message"]
    sender = settings["target-sender"] or settings["sender"]
    if message in ids and sender.isdecimal():
        yield from _contents(path, ids[message], int(sender), message, is_needed=True)


def _way_points(path: Path, settings: Settings, _ids: Ids) -> Iterator[InputError]:
    from dodo_dsl.opendlv.assets.trajectory import Trajectory, TrajectoryError, read_table

    try:
        Trajectory(read_table(path, 0.0), float(settings["speed"] or 1))
    except InputError as error:
        yield error
    except TrajectoryError as error:
        yield InputError(path, error.what, line=error.line)


def _car(path: Path, _settings: Settings, _ids: Ids) -> Iterator[InputError]:
    from dodo_dsl.opendlv.assets import car

    yield from _raised(lambda: car.read_car(path))


def _recording(path: Path, settings: Settings, _ids: Ids) -> Iterator[InputError]:
    sender = settings["video-sender"] if settings["video"] == "true" else ""
    wanted = (IMAGE, int(sender)) if sender.isdecimal() else (-1, 0)
    yield from _contents(path, *wanted, _IMAGE_NAME, is_needed=False)


def _contents(path: Path, message: int, sender: int, name: str, *, is_needed: bool) -> Iterator[InputError]:
    from dodo_dsl.opendlv.assets import recording_contents

    return recording_contents.problems(path, message, sender, name, is_needed)


def _pictures(path: Path, settings: Settings, ids: Ids) -> Iterator[InputError]:
    if path.suffix == RECORDING:
        yield from _recording(path, {"video": "", "video-sender": ""}, ids)
    elif path.suffix.lower() in PICTURES:
        yield from _picture(path)


_FORMATS: Mapping[str, Format] = {
    "map": _map,
    "obstacles": _obstacles,
    "truth": _truth,
    "target": _target,
    "way-points": _way_points,
    "car": _car,
    "recording": _recording,
    "pictures": _pictures,
}
SETTINGS: Mapping[str, tuple[str, ...]] = {
    "truth": ("truth-frames", "classes"),
    "target": ("field", "message", "sender", "target-field", "target-message", "target-sender"),
    "way-points": ("speed",),
    "recording": ("video", "video-sender"),
    "obstacles": ("bodies", "frame-id"),
}
"""The parameters that say how a file of a format is read."""
HELP: Mapping[str, str] = {
    "map": "docs/reference/maps.md has an example",
    "obstacles": "docs/reference/maps.md has an example",
    "truth": "services/object_detection/README.md shows what a truth has",
    "target": "services/continuous_signal/README.md shows what a target has",
    "way-points": "services/beacon/README.md shows what a path has",
    "car": "services/dynamic_model/README.md lists the parameters",
}
"""Where to read on, for problems without their own hint."""


def _raised(read: Callable[[], object]) -> list[InputError]:
    """What a reader raises."""
    try:
        read()
    except InputError as error:
        return [error]
    return []
