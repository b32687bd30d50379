"""The exports of ``dodo rec export``, by the option that asks for one, and data sets of one recording or of many.

A data set is pictures with labels, with a part for validation.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from dodo_dsl import atomic
from dodo_dsl.atomic import refuse_existing
from dodo_dsl.cli.errors import require_extra
from dodo_dsl.cli.rec_actions import RecJob, opened, tell
from dodo_dsl.opendlv.assets import truth_file
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.rec import coco, csv_table, steering
from dodo_dsl.rec.coco import LabelError
from dodo_dsl.rec.frames import FramesError, PictureSet, frame_names, images_of, write_picture
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


def images_for(job: RecJob) -> tuple[Numbers, Numbers]:
    """The selected frames of one camera, and all selected rows."""
    if job.options.message:
        raise NothingSelected(f"--message does not apply to --{job.options.format}; choose a sender with --camera")
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


def _frames(job: RecJob) -> None:
    recording, options, folder = job.recording, job.options, job.folder()
    images, _ = images_for(job)
    refuse_existing([folder / name for name in frame_names(recording, images, options.pictures)], options.force)
    with atomic.files_into(folder) as place, job.progress("decoding frames", len(images)) as progress:
        pictures = PictureSet(place, options.pictures, job.tell, inside="")
        for _, frame, file in pictures.frames(recording, images, "", progress):
            write_picture(place / file, frame)
        if pictures.lost == len(images):
            raise FramesError(f"no frame of {recording.path} can be decoded")
    for text in pictures.notes():
        job.tell(text)
    job.stdout.write(f"{folder}: {len(images) - pictures.lost} frames\n")


def _video(job: RecJob) -> None:
    output = job.file(".mp4")
    images, _ = images_for(job)
    with atomic.replacing(output) as place, job.progress(f"writing {output.name}", len(images)) as progress:
        video = write_video(job.recording, images, place, progress, job.tell)
    if lost := len(images) - video.frames:
        job.tell(f"{lost} of {len(images)} packets cannot be decoded or come before the first key frame")
    if moved := video.moved:
        why = f"as sample times do not rise, or are more than {MOST_GAP // 60_000_000} minutes apart"
        job.tell(f"moved {moved} frame{'s' * (moved > 1)}, {why}")
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
    "frames": _frames,
    "video": _video,
    "mcap": _mcap,
    "ros": _ros,
}

_TABLES = {"coco": coco.ANNOTATIONS, "steering": steering.TABLE}


def is_data_set(options: argparse.Namespace) -> bool:
    """Whether the command line asks for a data set, which may join recordings."""
    return options.format in _TABLES


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
    numbers = {path: f"{number:03}-" for number, path in enumerate(files, 1)} if len(files) > 1 else {}
    sets: dict[str, coco.CocoExport | steering.SteeringExport] = {}
    with atomic.files_into(folder) as place:
        for part, chosen in parts.items():
            sets[part] = _data_set(options, place / part, {path: numbers.get(path, "") for path in chosen}, stderr)
        classes = set[str]().union(*(each.classes for each in sets.values()))
        for each in sets.values():
            each.finish(classes)
    for part, each in sets.items():
        of = f" of {len(parts[part])} recordings" if len(files) > 1 else ""
        stdout.write(f"{folder / part}: {each}{of}\n")


def _data_set(
    options: argparse.Namespace, folder: Path, files: Mapping[Path, str], stderr: TextIO
) -> coco.CocoExport | steering.SteeringExport:
    """Pictures of recordings by the beginnings of their names."""

    def told(text: str) -> None:
        tell(stderr, text)

    export: coco.CocoExport | steering.SteeringExport
    if options.format == "coco":
        export = coco.CocoExport(folder, options.pictures, told, everything=options.all)
    else:
        export = steering.SteeringExport(folder, options.pictures, told)
    for path, name in files.items():
        with opened(path, options, stderr, stderr) as (job, _):
            images, rows = images_for(job)
            with job.progress(f"decoding {path.name}", len(images)) as progress:
                if isinstance(export, coco.CocoExport):
                    export.add(job.recording, images, boxes_of(job, rows, images), name, progress)
                else:
                    export.add(
                        job.recording, images, steering.answers(job.recording, job.messages, rows), name, progress
                    )
    if not export.images:
        named = next(iter(files)) if len(files) == 1 else f"{len(files)} recordings"
        raise LabelError(f"no frame of {named} that can be decoded {export.missing}")
    for text in export.notes():
        told(text)
    return export
