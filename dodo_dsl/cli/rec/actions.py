"""The actions of ``dodo rec``."""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np

from dodo_dsl import atomic
from dodo_dsl.cli.progress_bar import progress_bar
from dodo_dsl.cli.rec.message_sets import messages_for
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.messages.varints import Numbers
from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.rec import coco, contents, csv_table, cut, labels
from dodo_dsl.rec.contents_text import contents_text
from dodo_dsl.rec.excerpt import Excerpt, NothingSelected
from dodo_dsl.rec.frames import IMAGE
from dodo_dsl.rec.outputs import refuse_existing
from dodo_dsl.terminal import json_text, printable

MOST_TABLES = 1000


@dataclass(frozen=True)
class _Job:
    options: argparse.Namespace
    recording: Recording
    messages: MessageSet
    stdout: TextIO
    stderr: TextIO

    def tell(self, text: str) -> None:
        _tell(self.stderr, text)

    def rows(self) -> Numbers:
        """The rows that the command line selects; reports damage first."""
        if self.recording.damage:
            self.tell(f"{self.recording.path}: {self.recording.damage}")
        options = self.options
        return Excerpt(options.message, options.start, options.end).rows(self.recording, self.messages)

    def folder(self) -> Path:
        folder: Path = self.options.output or self.options.file.with_suffix("")
        if folder.exists() and not folder.is_dir():
            raise NothingSelected(f"'{folder}' is not a folder; name one with -o")
        return folder


def _tell(stderr: TextIO, text: str) -> None:
    stderr.write(f"dodo rec: {printable(text)}\n")


def run(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> None:
    """Carries out one action; raises OSError and what else ``cli.errors`` has a sentence for."""
    path: Path = options.file
    with progress_bar(stderr, f"reading {path.name}", path.stat().st_size) as progress:
        recording = Recording(path, progress)
    with recording:
        version, messages = messages_for(recording, options.messages, lambda text: _tell(stderr, text))
        job = _Job(options, recording, messages, stdout, stderr)
        if options.action == "info":
            _info(job, version)
        elif options.action == "cut":
            _cut(job)
        elif options.csv:
            _csv(job)
        else:
            _coco(job)


def _info(job: _Job, version: str) -> None:
    images = len(job.recording.rows(messages=[IMAGE]))
    with progress_bar(job.stderr, "decoding frames", images) as progress:
        decoding = None if job.options.no_decode else progress
        found = contents.look(job.recording, job.messages, version, decoding, job.tell)
    if job.options.json:
        job.stdout.write(json_text(found.as_json(job.recording)))
    else:
        job.stdout.write(contents_text(found, job.recording))


def _cut(job: _Job) -> None:
    output: Path = job.options.output
    if output.exists() and output.samefile(job.recording.path):
        raise NothingSelected(f"'{output}' is the recording itself; name another file with -o")
    refuse_existing([output], job.options.force)
    rows = job.rows()
    with (
        atomic.replacing(output, durable=True) as place,
        progress_bar(job.stderr, f"writing {output.name}", len(rows)) as progress,
    ):
        cut.write(job.recording, rows, place, progress)
    job.stdout.write(f"{output}: {len(rows)} of {len(job.recording)} messages\n")


def _csv(job: _Job) -> None:
    recording, messages, folder = job.recording, job.messages, job.folder()
    rows = job.rows()
    types = recording.index["data_type"][rows]
    known = rows[np.isin(types, list(messages.ids()))]
    if not len(known):
        raise NothingSelected(f"{recording.path} has only unknown messages; name their .odvd file with --messages")
    names = csv_table.names(recording, messages, known)
    if len(names) > MOST_TABLES:
        reason = f"would become {len(names)} tables, expected at most {MOST_TABLES}"
        raise NothingSelected(f"{recording.path} {reason}; choose messages with --message")
    refuse_existing([folder / name for name in names], job.options.force)
    with atomic.files_into(folder) as place, progress_bar(job.stderr, "writing tables", len(known)) as progress:
        undecodable = csv_table.write(recording, messages, known, place, progress)
    for id_, count in undecodable.items():
        job.tell(f"skipped {count} payload{'s' * (count > 1)} of {messages.name(id_)} that cannot be decoded")
    if unknown := sorted(set(types.tolist()) - messages.ids()):
        job.tell(f"skipped unknown messages: {', '.join(map(str, unknown))}")
    job.stdout.write(f"{folder}: {len(names)} tables with {len(known) - undecodable.total()} rows\n")


def _labels(job: _Job, rows: Numbers, images: Numbers) -> Mapping[int, list[coco.Detection]]:
    if job.options.truth is None:
        return coco.detections(job.recording, job.messages, rows, job.options.labels)
    if job.options.labels is not None:
        raise NothingSelected("--truth and --labels exclude each other: boxes come from a file or from a sender")
    return labels.of_truth(job.recording, images, job.options.truth)


def _coco(job: _Job) -> None:
    recording, options, folder = job.recording, job.options, job.folder()
    if options.message:
        raise NothingSelected("--message does not apply to --coco; choose senders with --camera and --labels")
    rows = job.rows()
    images = coco.images_of(recording, rows, options.camera)
    boxes = _labels(job, rows, images)
    if not boxes and not options.all:
        raise NothingSelected(f"{recording.path} has no detections with a box; --all exports frames without them")
    refuse_existing([folder / coco.ANNOTATIONS], options.force)
    with atomic.files_into(folder) as place, progress_bar(job.stderr, "decoding frames", len(images)) as progress:
        export = coco.Export(place, options.pictures, options.all, progress, job.tell)
        result = export.write(recording, images, boxes)
    if result.lost:
        job.tell(f"{result.lost} of {len(images)} packets cannot be decoded")
    job.stdout.write(f"{folder}: {len(result.images)} frames with {len(result.boxes)} boxes\n")
