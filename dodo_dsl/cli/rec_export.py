"""The exports of ``dodo rec export``, by the option that asks for one, and data sets of one recording or of many.

A data set is pictures with labels, with a part for validation.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

import numpy as np

from dodo_dsl import atomic
from dodo_dsl.atomic import refuse_existing
from dodo_dsl.cli.display import progress_bar
from dodo_dsl.cli.errors import require_extra
from dodo_dsl.cli.rec_actions import RecJob, messages_for, tell
from dodo_dsl.opendlv.assets import truth_file
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.rec import coco, csv_table, steering
from dodo_dsl.rec import video as rec_video
from dodo_dsl.rec.coco import LabelError
from dodo_dsl.rec.frames import images_of
from dodo_dsl.rec.recording_filter import NothingSelected
from dodo_dsl.rec.steering import split_recordings
from dodo_dsl.rec.video import MOST_GAP, write_video

MOST_TABLES = 1000


def _csv(job: RecJob) -> None:
    recording, messages, folder = job.recording, job.messages, job.folder()
    known, unknown = _known(job)
    names = csv_table.names(recording, messages, known)
    _refuse_many(job, len(names), "tables")
    refuse_existing([folder / name for name in names], job.options.force)
    with atomic.files_into(folder) as place, job.progress("writing tables", len(known)) as progress:
        undecodable = csv_table.write(recording, messages, known, place, progress)
    _tell_skipped(job, undecodable, unknown)
    job.stdout.write(f"{folder}: {len(names)} tables with {len(known) - undecodable.total()} rows\n")


def _known(job: RecJob) -> tuple[Numbers, list[int]]:
    """The selected rows with known messages, and the ids of the unknown ones; raises NothingSelected for none."""
    rows = job.rows()
    types = job.recording.index["data_type"][rows]
    known: Numbers = rows[np.isin(types, list(job.messages.ids()))]
    if not len(known):
        raise NothingSelected(f"{job.recording.path} has only unknown messages; name their .odvd file with --messages")
    return known, sorted(set(types.tolist()) - job.messages.ids())


def _refuse_many(job: RecJob, count: int, what: str) -> None:
    if count > MOST_TABLES:
        reason = f"would become {count} {what}, expected at most {MOST_TABLES}"
        raise NothingSelected(f"{job.recording.path} {reason}; choose messages with --message")


def _tell_skipped(job: RecJob, undecodable: Mapping[int, int], unknown: list[int]) -> None:
    for id_, count in undecodable.items():
        name = job.messages.name(id_)
        job.tell(f"skipped {count} payload{'s' * (count > 1)} of {name} that cannot be decoded")
    if unknown:
        job.tell(f"skipped unknown messages: {', '.join(map(str, unknown))}")


def _coco(job: RecJob) -> None:
    recording, options, folder = job.recording, job.options, job.folder()
    images, rows = images_for(job, "choose senders with --camera and --labels")
    boxes = boxes_of(job, rows, images)
    if not boxes and not options.all:
        raise NothingSelected(f"{recording.path} has no detections with a box; --all exports frames without them")
    refuse_existing([folder / coco.ANNOTATIONS], options.force)
    with atomic.files_into(folder) as place, job.progress("decoding frames", len(images)) as progress:
        export = coco.CocoExport(place, options.pictures, options.all, progress, job.tell)
        result = export.write(recording, images, boxes)
    _tell_lost(job, result.lost, len(images))
    _tell_boxes(job.tell, result)
    job.stdout.write(f"{folder}: {len(result.images)} frames with {len(result.boxes)} boxes\n")


def images_for(job: RecJob, instead: str) -> tuple[Numbers, Numbers]:
    """The selected frames of one camera, and all selected rows."""
    if job.options.message:
        raise NothingSelected(f"--message does not apply to --{job.options.format}; {instead}")
    rows = job.rows()
    return images_of(job.recording, rows, job.options.camera), rows


def boxes_of(job: RecJob, rows: Numbers, images: Numbers) -> Mapping[int, list[coco.Detection]]:
    """The boxes that label the frames, by sample time; raises NothingSelected."""
    if job.options.truth is None:
        return coco.detections(job.recording, job.messages, rows, job.options.labels)
    if job.options.labels is not None:
        raise NothingSelected("--truth and --labels exclude each other: boxes come from a file or from a sender")
    found = coco.of_truth(job.recording, images, job.options.truth)
    for slip in truth_file.corners(job.options.truth):
        job.tell(f"{slip}; {slip.hint}")
    return found


def _tell_boxes(tell: Callable[[str], None], result: coco.DataSet) -> None:
    if result.cut:
        tell(f"cut {result.cut} boxes at the edges of their frames")
    if result.empty:
        tell(f"left out {result.empty} boxes without an area in their frames")


def _tell_lost(job: RecJob, lost: int, of: int) -> None:
    if lost:
        job.tell(f"{lost} of {of} packets cannot be decoded")


def tell_lost(stderr: TextIO, lost: int) -> None:
    """Says how many packets of all recordings gave no frame."""
    if lost:
        tell(stderr, f"{lost} packet{'s' * (lost > 1)} cannot be decoded")


def _frames(job: RecJob) -> None:
    recording, options, folder = job.recording, job.options, job.folder()
    images, _ = images_for(job, "choose a sender with --camera")
    names = rec_video.frame_names(recording, images, options.pictures)
    refuse_existing([folder / name for name in names], options.force)
    with atomic.files_into(folder) as place, job.progress("decoding frames", len(images)) as progress:
        written = rec_video.write_frames(recording, images, options.pictures, place, progress, job.tell)
    _tell_lost(job, len(images) - written, len(images))
    job.stdout.write(f"{folder}: {written} frames\n")


def _video(job: RecJob) -> None:
    output = job.file(".mp4")
    images, _ = images_for(job, "choose a sender with --camera")
    with atomic.replacing(output) as place, job.progress(f"writing {output.name}", len(images)) as progress:
        video = write_video(job.recording, images, place, progress, job.tell)
    if lost := len(images) - video.frames:
        job.tell(f"{lost} of {len(images)} packets cannot be decoded or come before the first key frame")
    if late := video.late:
        job.tell(f"moved {late} frame{'s' * (late > 1)} to 1 us after the one before, as sample times do not rise")
    if gaps := video.gaps:
        job.tell(f"shortened {gaps} gap{'s' * (gaps > 1)} between frames to {MOST_GAP // 60_000_000} minutes")
    how = "encoded again" if video.encoded else "as recorded"
    job.stdout.write(f"{output}: {video.frames} frames of {video.size[0]} x {video.size[1]} pixels, {how}\n")


def _mcap(job: RecJob) -> None:
    require_extra("--mcap", "mcap")
    from dodo_dsl.rec import mcap

    output = job.file(".mcap")
    known, unknown = _known(job)
    topics = len(csv_table.names(job.recording, job.messages, known))
    _refuse_many(job, topics, "topics")
    with atomic.replacing(output) as place, job.progress(f"writing {output.name}", len(known)) as progress:
        written = mcap.write_mcap(job.recording, job.messages, known, place, progress)
    _tell_skipped(job, written.undecodable, unknown)
    job.stdout.write(f"{output}: {written.messages} messages, and {written.converted} of them for Foxglove, too\n")


def _ros(job: RecJob) -> None:
    from dodo_dsl.cli import rec_bag

    rec_bag.export_bag(job)


EXPORTS: Mapping[str, Callable[[RecJob], None]] = {
    "csv": _csv,
    "coco": _coco,
    "frames": _frames,
    "video": _video,
    "mcap": _mcap,
    "ros": _ros,
}

FORMATS = ("coco", "steering")
_TABLES = {"coco": coco.ANNOTATIONS, "steering": steering.TABLE}


def is_data_set(options: argparse.Namespace) -> bool:
    """Whether the command line asks for a data set that may join recordings."""
    return options.format == "steering" or (options.format == "coco" and (len(options.files) > 1 or options.validation))


def run(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> None:
    """Writes all parts of a data set, or nothing; raises what the exports of one recording raise, and SplitError."""
    files: Sequence[Path] = options.files
    if len(files) > 1 and options.output is None:
        raise NothingSelected("name the folder of the data set with -o")
    folder: Path = options.output or files[0].with_suffix("")
    if folder.exists() and not folder.is_dir():
        raise NothingSelected(f"'{folder}' is not a folder; name one with -o")
    parts = split_recordings(files, options.validation, options.seed)
    refuse_existing([folder / part / _TABLES[options.format] for part in parts], options.force)
    numbers = {path: f"{number:03}" for number, path in enumerate(files, 1)} if len(files) > 1 else {}
    said, sets = [], list[coco.CocoExport]()
    with atomic.files_into(folder) as place:
        for part, chosen in parts.items():
            inputs = [(path, numbers.get(path, "")) for path in chosen]
            if options.format == "coco":
                sets.append(_coco_set(options, place / part, inputs, stderr))
                result = sets[-1].result
                found = f"{len(result.images)} frames with {len(result.boxes)} boxes of {_count(inputs)}"
            else:
                found = _steering(options, place / part, inputs, stderr)
            said.append(f"{folder / part}: {found}\n")
        for each in sets:
            each.finish(set[str]().union(*(other.result.classes for other in sets)))
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


def _coco_set(
    options: argparse.Namespace, folder: Path, files: Sequence[tuple[Path, str]], stderr: TextIO
) -> coco.CocoExport:
    export = coco.CocoExport(folder, options.pictures, options.all, _no_progress, lambda text: tell(stderr, text))
    for path, name in files:
        with _opened(path, options, stderr) as job:
            images, rows = images_for(job, "choose senders with --camera and --labels")
            boxes = boxes_of(job, rows, images)
            with _counted(job, export, len(images)):
                export.add(job.recording, images, boxes, name)
    tell_lost(stderr, export.result.lost)
    _tell_boxes(lambda text: tell(stderr, text), export.result)
    if not export.result.images:
        raise LabelError(f"no frame of {_named(files)} has a detection; --all exports frames without them")
    return export


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
