"""The actions of ``dodo rec``."""

import argparse
from pathlib import Path
from typing import TextIO

from dodo_dsl import atomic
from dodo_dsl.cli.progress_bar import progress_bar
from dodo_dsl.cli.rec.job import RecJob, tell
from dodo_dsl.cli.rec.message_sets import messages_for
from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.rec import contents, cut
from dodo_dsl.rec.contents_text import contents_text
from dodo_dsl.rec.excerpt import NothingSelected
from dodo_dsl.rec.frames import IMAGE
from dodo_dsl.terminal import json_text


def run(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> None:
    """Carries out one action; raises OSError and what else ``cli.errors`` has a sentence for."""
    if options.action == "export":
        from dodo_dsl.cli.rec import datasets

        if datasets.is_data_set(options):
            datasets.run(options, stdout, stderr)
            return
        options.file = _only_one(options)
    path: Path = options.file
    with progress_bar(stderr, f"reading {path.name}", path.stat().st_size) as progress:
        recording = Recording(path, progress)
    with recording:
        version, messages = messages_for(recording, options.messages, lambda text: tell(stderr, text))
        job = RecJob(options, recording, messages, stdout, stderr)
        if options.action == "info":
            _info(job, version)
        elif options.action == "cut":
            _cut(job)
        else:
            from dodo_dsl.cli.rec import exports

            exports.EXPORTS[options.format](job)


def _only_one(options: argparse.Namespace) -> Path:
    """The recording, for what takes one; raises NothingSelected for several."""
    files: list[Path] = options.files
    if len(files) > 1:
        raise NothingSelected(f"--{options.format} takes one recording; only --coco and --steering join several")
    return files[0]


def _info(job: RecJob, version: str) -> None:
    images = len(job.recording.rows(messages=[IMAGE]))
    with job.progress("decoding frames", images) as progress:
        decoding = None if job.options.no_decode else progress
        found = contents.look(job.recording, job.messages, version, decoding, job.tell)
    if job.options.json:
        job.stdout.write(json_text(found.as_json(job.recording)))
    else:
        job.stdout.write(contents_text(found, job.recording))


def _cut(job: RecJob) -> None:
    output = job.file()
    rows = job.rows()
    with atomic.replacing(output, durable=True) as place, job.progress(f"writing {output.name}", len(rows)) as progress:
        cut.write(job.recording, rows, place, progress)
    job.stdout.write(f"{output}: {len(rows)} of {len(job.recording)} messages\n")
