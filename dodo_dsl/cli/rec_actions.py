"""The actions of ``dodo rec``, the recording that they open, and the messages that they know.

Known are a set by version, messages of files, and those of the repository around the recording.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np

from dodo_dsl import atomic
from dodo_dsl.atomic import refuse_existing
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.opendlv import message_versions
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.odvd import OdvdError
from dodo_dsl.opendlv.recording import Recording, matching
from dodo_dsl.opendlv.recording_writer import RecordingWriter
from dodo_dsl.rec import contents
from dodo_dsl.rec.contents import contents_text
from dodo_dsl.spec.deployment import find_deployment, load_deployment
from dodo_dsl.terminal import json_text, printable

ABSOLUTE_S = 1e8
"""Seconds from here on are counted since 1970, those below since the recording's start."""


@dataclass(frozen=True)
class RecJob:
    """A command line, the recording that it names, opened, and its messages."""

    options: argparse.Namespace
    recording: Recording
    version: str
    messages: MessageSet
    stdout: TextIO
    stderr: TextIO

    def tell(self, text: str) -> None:
        """A sentence for the user, besides the result."""
        tell(self.stderr, text)

    def rows(self) -> Numbers:
        """The rows that the command line selects, in the order of the file; reports damage first. Raises UsageError."""
        recording, options = self.recording, self.options
        if recording.damage:
            self.tell(f"{recording.path}: {recording.damage}")
        times = recording.index["time"]
        begin = int(times[times != 0].min(initial=np.iinfo(np.int64).max))
        rows = recording.rows(start=_microseconds(options.start, begin), end=_microseconds(options.end, begin))
        if options.message:
            try:
                rows = rows[matching(recording.index[rows], map(self.messages.key, options.message))]
            except MessageError as error:
                raise UsageError(str(error)) from None
        if not len(rows):
            raise UsageError(f"nothing selected: no message of {recording.path} is within --start, --end, --message")
        return rows

    def folder(self) -> Path:
        """The output folder; raises UsageError for what is none."""
        folder: Path = self.options.output or self.recording.path.with_suffix("")
        if folder.exists() and not folder.is_dir():
            raise UsageError(f"'{folder}' is not a folder; name one with -o")
        return folder

    def file(self, suffix: str = "") -> Path:
        """The output file; raises UsageError for the recording itself, OutputExists for one that stays."""
        output: Path = self.options.output or self.recording.path.with_suffix(suffix)
        if output.exists() and output.samefile(self.recording.path):
            raise UsageError(f"'{output}' is the recording itself; name another file with -o")
        refuse_existing([output], self.options.force)
        return output


def _microseconds(seconds: float | None, begin: int) -> int | None:
    return None if seconds is None else round(seconds * 1e6) + (0 if seconds >= ABSOLUTE_S else begin)


def tell(stderr: TextIO, text: str) -> None:
    """A line for the user."""
    stderr.write(f"dodo rec: {printable(text)}\n")


Tell = Callable[[str], None]


def messages_for(recording: Recording, wanted: Sequence[str], tell: Tell) -> tuple[str, MessageSet]:
    """The version of the set and its messages; ``wanted`` are versions and ODVD files of the command line.

    The ODVD files of the nearest ``dodo.yml`` are added. If they cannot be used, ``tell`` gets a sentence, and the rest
    is used without them. Raises OdvdError for files of the command line.
    """
    chosen = [word for word in wanted if word in (message_versions.OLD, message_versions.NEW)]
    files = [Path(word) for word in wanted if word not in chosen]
    version = chosen[-1] if chosen else message_versions.version_of(recording)
    messages = message_versions.load(version, *files)
    if path := find_deployment(Path.cwd()):
        deployment, problems = load_deployment(path)
        places = [(each.span, each.message) for each in problems if each.severity == "error"]
        errors = [f"{span.file}:{span.line}:{span.column}: {message}" for span, message in places]
        try:
            if not errors:
                return version, message_versions.load(version, *deployment.messages, *files)
        except OdvdError as error:
            errors = [str(error)]
        tell(f"{errors[0]}; the messages of {path} are skipped")
    return version, messages


def run(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> None:
    """Carries out one action; raises OSError and what else ``cli.errors`` has a sentence for."""
    if options.action == "import":
        from dodo_dsl.cli import rec_bag

        rec_bag.import_bag(options, stdout, stderr)
        return
    if options.action == "export":
        from dodo_dsl.cli import rec_export

        rec_export.run(options, stdout, stderr)
        return
    with opened(options.file, options, stdout, stderr) as job:
        if options.action == "info":
            _info(job)
        else:
            _cut(job)


@contextmanager
def opened(path: Path, options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> Iterator[RecJob]:
    """A recording of the command line."""
    with Recording(path) as recording:
        version, messages = messages_for(recording, options.messages, lambda text: tell(stderr, text))
        yield RecJob(options, recording, version, messages, stdout, stderr)


def _info(job: RecJob) -> None:
    found = contents.look(job.recording, job.messages, job.version, not job.options.no_decode, job.tell)
    if job.options.json:
        job.stdout.write(json_text(found.as_json(job.recording)))
    else:
        job.stdout.write(contents_text(found, job.recording))


def _cut(job: RecJob) -> None:
    output = job.file()
    rows = job.rows()
    with atomic.replacing(output, durable=True) as place, RecordingWriter(place) as writer:
        for batch in job.recording.batches(rows):
            writer.write_frames(batch.frames())
    job.stdout.write(f"{output}: {len(rows)} of {len(job.recording)} messages\n")
