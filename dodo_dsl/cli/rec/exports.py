"""The exports of ``dodo rec export``, by the option that asks for one."""

from collections.abc import Callable, Mapping
from typing import TextIO

import numpy as np

from dodo_dsl import atomic
from dodo_dsl.cli.errors import require_extra
from dodo_dsl.cli.rec.job import RecJob, tell
from dodo_dsl.opendlv.messages.varints import Numbers
from dodo_dsl.rec import coco, csv_table, labels
from dodo_dsl.rec.excerpt import NothingSelected
from dodo_dsl.rec.export import frame_files, video_file
from dodo_dsl.rec.export.video_times import MOST_GAP
from dodo_dsl.rec.frames import images_of
from dodo_dsl.rec.outputs import refuse_existing

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
    return labels.of_truth(job.recording, images, job.options.truth)


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
    names = frame_files.names(recording, images, options.pictures)
    refuse_existing([folder / name for name in names], options.force)
    with atomic.files_into(folder) as place, job.progress("decoding frames", len(images)) as progress:
        written = frame_files.write(recording, images, options.pictures, place, progress, job.tell)
    _tell_lost(job, len(images) - written, len(images))
    job.stdout.write(f"{folder}: {written} frames\n")


def _video(job: RecJob) -> None:
    output = job.file(".mp4")
    images, _ = images_for(job, "choose a sender with --camera")
    with atomic.replacing(output) as place, job.progress(f"writing {output.name}", len(images)) as progress:
        video = video_file.write(job.recording, images, place, progress, job.tell)
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
    from dodo_dsl.rec.export import mcap_file

    output = job.file(".mcap")
    known, unknown = _known(job)
    topics = len(csv_table.names(job.recording, job.messages, known))
    _refuse_many(job, topics, "topics")
    with atomic.replacing(output) as place, job.progress(f"writing {output.name}", len(known)) as progress:
        written = mcap_file.write(job.recording, job.messages, known, place, progress)
    _tell_skipped(job, written.undecodable, unknown)
    job.stdout.write(f"{output}: {written.messages} messages, and {written.converted} of them for Foxglove, too\n")


EXPORTS: Mapping[str, Callable[[RecJob], None]] = {
    "csv": _csv,
    "coco": _coco,
    "frames": _frames,
    "video": _video,
    "mcap": _mcap,
}
