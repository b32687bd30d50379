"""Data sets of ``dodo rec export``: pictures with labels, of one recording or of many, with a part for validation."""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from dodo_dsl import atomic
from dodo_dsl.cli.progress_bar import progress_bar
from dodo_dsl.cli.rec.exports import boxes_of, images_for, tell_lost
from dodo_dsl.cli.rec.job import RecJob, tell
from dodo_dsl.cli.rec.message_sets import messages_for
from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.rec import coco, steering
from dodo_dsl.rec.coco import LabelError
from dodo_dsl.rec.excerpt import NothingSelected
from dodo_dsl.rec.outputs import refuse_existing
from dodo_dsl.rec.parts import split

FORMATS = ("coco", "steering")
_TABLES = {"coco": coco.ANNOTATIONS, "steering": steering.TABLE}


def is_data_set(options: argparse.Namespace) -> bool:
    """Whether the command line asks for a data set that may join recordings."""
    return options.format == "steering" or (options.format == "coco" and (len(options.files) > 1 or options.validation))


def run(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> None:
    """Writes all parts, or nothing; raises what the exports of one recording raise, and SplitError."""
    files: Sequence[Path] = options.files
    if len(files) > 1 and options.output is None:
        raise NothingSelected("name the folder of the data set with -o")
    folder: Path = options.output or files[0].with_suffix("")
    if folder.exists() and not folder.is_dir():
        raise NothingSelected(f"'{folder}' is not a folder; name one with -o")
    parts = split(files, options.validation, options.seed)
    refuse_existing([folder / part / _TABLES[options.format] for part in parts], options.force)
    numbers = {path: f"{number:03}" for number, path in enumerate(files, 1)} if len(files) > 1 else {}
    said = []
    with atomic.files_into(folder) as place:
        for part, chosen in parts.items():
            write = _coco if options.format == "coco" else _steering
            found = write(options, place / part, [(path, numbers.get(path, "")) for path in chosen], stderr)
            said.append(f"{folder / part}: {found}\n")
    stdout.writelines(said)


@contextmanager
def _opened(path: Path, options: argparse.Namespace, stderr: TextIO) -> Iterator[RecJob]:
    with progress_bar(stderr, f"reading {path.name}", path.stat().st_size) as progress:
        recording = Recording(path, progress)
    with recording:
        _, messages = messages_for(recording, options.messages, lambda text: tell(stderr, text))
        yield RecJob(options, recording, messages, stdout=stderr, stderr=stderr)


def _no_progress(_: int) -> None:
    """Pictures of a recording are counted by its own bar."""


def _coco(options: argparse.Namespace, folder: Path, files: Sequence[tuple[Path, str]], stderr: TextIO) -> str:
    export = coco.CocoExport(folder, options.pictures, options.all, _no_progress, lambda text: tell(stderr, text))
    for path, name in files:
        with _opened(path, options, stderr) as job:
            images, rows = images_for(job, "choose senders with --camera and --labels")
            boxes = boxes_of(job, rows, images)
            with _counted(job, export, len(images)):
                export.add(job.recording, images, boxes, name)
    tell_lost(stderr, export.result.lost)
    if not export.result.images:
        raise LabelError(f"no frame of {_named(files)} has a detection; --all exports frames without them")
    export.finish()
    return f"{len(export.result.images)} frames with {len(export.result.boxes)} boxes of {_count(files)}"


def _steering(options: argparse.Namespace, folder: Path, files: Sequence[tuple[Path, str]], stderr: TextIO) -> str:
    export = steering.SteeringExport(folder, options.pictures, _no_progress, lambda text: tell(stderr, text))
    for path, name in files:
        with _opened(path, options, stderr) as job:
            images, rows = images_for(job, "choose a sender with --camera")
            with _counted(job, export, len(images)):
                export.add(job.recording, job.messages, rows, images, name)
    tell_lost(stderr, export.lost)
    if not export.rows:
        raise LabelError(f"no frame of {_named(files)} has a GroundSteeringRequest of its sample time or soon after it")
    if export.unanswered:
        tell(stderr, f"left out {export.unanswered} frames without a GroundSteeringRequest within 0.2 s")
    export.finish()
    return f"{len(export.rows)} frames with steering of {_count(files)}"


@contextmanager
def _counted(job: RecJob, export: "coco.CocoExport | steering.SteeringExport", images: int) -> Iterator[None]:
    with job.progress(f"decoding {job.recording.path.name}", images) as progress:
        show: Callable[[int], None] = progress
        export.progress = show
        yield
    export.progress = _no_progress


def _named(files: Sequence[tuple[Path, str]]) -> str:
    return str(files[0][0]) if len(files) == 1 else f"{len(files)} recordings"


def _count(files: Sequence[tuple[Path, str]]) -> str:
    return f"{len(files)} recording{'s' * (len(files) > 1)}"
