"""The exports of ``dodo rec export``, by the option that asks for one."""

import argparse
import random
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from dodo_dsl import atomic
from dodo_dsl.atomic import refuse_existing
from dodo_dsl.cli.errors import UsageError, require_extra
from dodo_dsl.cli.rec_actions import RecJob, opened, tell
from dodo_dsl.cli.rec_bag import export_bag
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.rec import coco, csv_table
from dodo_dsl.rec.frames import frame_names, frames, images_of, write_picture
from dodo_dsl.rec.video import write_video

MOST_TABLES = 1000


def _csv(job: RecJob) -> None:
    folder = job.folder()
    known, names = _known(job, "tables")
    refuse_existing([folder / name for name in names], job.options.force)
    with atomic.files_into(folder) as place:
        undecodable = csv_table.write(job.recording, job.messages, known, place)
    _tell_skipped(job, undecodable)
    job.stdout.write(f"{folder}: {len(names)} tables with {len(known) - undecodable.total()} rows\n")


def _known(job: RecJob, become: str) -> tuple[Numbers, list[str]]:
    """The selected rows with known messages, and the names of their tables; raises UsageError."""
    rows, path = job.rows(), job.recording.path
    types = job.recording.index["data_type"][rows]
    known: Numbers = rows[np.isin(types, list(job.messages.ids()))]
    if not len(known):
        raise UsageError(f"{path} has only unknown messages; name their .odvd file with --messages")
    names = csv_table.names(job.recording, job.messages, known)
    if len(names) > MOST_TABLES:
        reason = f"would become {len(names)} {become}, expected at most {MOST_TABLES}"
        raise UsageError(f"{path} {reason}; choose messages with --message")
    if unknown := sorted(set(types.tolist()) - job.messages.ids()):
        job.tell(f"skipped unknown messages: {', '.join(map(str, unknown))}")
    return known, names


def _tell_skipped(job: RecJob, undecodable: Mapping[int, int]) -> None:
    for id_, count in undecodable.items():
        name = job.messages.name(id_)
        job.tell(f"skipped {count} payload{'s' * (count > 1)} of {name} that cannot be decoded")


def _images(job: RecJob) -> tuple[Numbers, Numbers]:
    """The selected frames of one camera, and all selected rows."""
    if job.options.message:
        raise UsageError(f"--message does not apply to --{job.options.format}; choose a sender with --camera")
    rows = job.rows()
    return images_of(job.recording, rows, job.options.camera), rows


def _frames(job: RecJob) -> None:
    folder, options = job.folder(), job.options
    images, _ = _images(job)
    names, count = frame_names(job.recording, images, options.pictures), 0
    refuse_existing([folder / name for name in names], options.force)
    with atomic.files_into(folder) as place:
        for number, _, frame in frames(job.recording, images, job.tell):
            write_picture(place / names[number], frame)
            count += 1
    job.stdout.write(f"{folder}: {count} frames\n")


def _video(job: RecJob) -> None:
    output = job.file(".mp4")
    images, _ = _images(job)
    with atomic.replacing(output) as place:
        count, (width, height) = write_video(job.recording, images, place, job.tell)
    job.stdout.write(f"{output}: {count} frames of {width} x {height} pixels\n")


def _mcap(job: RecJob) -> None:
    require_extra("--mcap", "mcap")
    from dodo_dsl.rec import mcap

    output = job.file(".mcap")
    known, _ = _known(job, "topics")
    with atomic.replacing(output) as place:
        written = mcap.write_mcap(job.recording, job.messages, known, place)
    _tell_skipped(job, written.undecodable)
    job.stdout.write(f"{output}: {written.messages} messages, and {written.converted} of them for Foxglove, too\n")


EXPORTS: Mapping[str, Callable[[RecJob], None]] = {
    "csv": _csv,
    "frames": _frames,
    "video": _video,
    "mcap": _mcap,
    "ros": export_bag,
}


def run(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> None:
    """Carries out an export; raises OSError and what else ``cli.errors`` has a sentence for."""
    if options.format == "coco":
        _data_set(options, stdout, stderr)
        return
    if len(options.files) > 1:
        raise UsageError(f"--{options.format} takes one recording")
    with opened(options.files[0], options, stdout, stderr) as job:
        EXPORTS[options.format](job)


def _data_set(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> None:
    """Frames and boxes of all recordings, some of which may be for validation; all of it or nothing."""
    files: Sequence[Path] = options.files
    if len(files) > 1 and options.output is None:
        raise UsageError("name the folder of the data set with -o")
    if options.truth and options.labels is not None:
        raise UsageError("--truth and --labels exclude each other: boxes come from a file or from a sender")
    folder: Path = options.output or files[0].with_suffix("")
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"'{folder}' is not a folder; name one with -o")
    parts = _parts(len(files), options.validation, options.seed)
    refuse_existing([folder / part / coco.ANNOTATIONS for part in parts], options.force)
    sets = {part: coco.DataSet() for part in parts}
    with atomic.files_into(folder) as place:
        for part, chosen in parts.items():
            for number in chosen:
                with opened(files[number], options, stdout, stderr) as job:
                    _add(job, sets[part], place / part, f"{number + 1:03}-" if len(files) > 1 else "")
        classes = {name for each in sets.values() for _, (name, _) in each.boxes}
        for part, each in sets.items():
            if not each.images:
                named = files[0] if len(files) == 1 else f"{len(parts[part])} recordings"
                raise UsageError(f"no frame of {named} that can be decoded has a detection with a box in it")
            each.finish(place / part, classes, lambda text: tell(stderr, text))
    for part, each in sets.items():
        of = f" of {len(parts[part])} recordings" if len(files) > 1 else ""
        stdout.write(f"{folder / part}: {len(each.images)} frames with {len(each.boxes)} boxes{of}\n")


def _parts(count: int, share: float, seed: int) -> dict[str, list[int]]:
    """The numbers of the recordings by part: whole ones, as frames of one drive are alike."""
    if not share:
        return {"": list(range(count))}
    if count < 2:
        raise UsageError("--validation needs two recordings or more, as frames of one drive are alike")
    wanted = min(max(round(share * count), 1), count - 1)
    chosen = sorted(random.Random(seed).sample(range(count), wanted))  # noqa: S311  (repeatable, not secret)
    return {"train": [n for n in range(count) if n not in chosen], "validation": chosen}


def _add(job: RecJob, found: coco.DataSet, folder: Path, prefix: str) -> None:
    images, rows = _images(job)
    if job.options.truth:
        labels = coco.of_truth(job.recording, images, job.options.truth)
    else:
        labels = coco.detections(job.recording, job.messages, rows, job.options.labels)
    found.add(job.recording, images, labels, folder, prefix, job.options.pictures, job.tell)
