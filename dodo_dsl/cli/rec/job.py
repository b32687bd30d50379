"""What every action of ``dodo rec`` works with."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from dodo_dsl.cli.progress_bar import progress_bar
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.messages.varints import Numbers
from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.rec.excerpt import Excerpt, NothingSelected
from dodo_dsl.rec.outputs import refuse_existing
from dodo_dsl.terminal import printable


@dataclass(frozen=True)
class RecJob:
    """A command line, the recording that it names, opened, and its messages."""

    options: argparse.Namespace
    recording: Recording
    messages: MessageSet
    stdout: TextIO
    stderr: TextIO

    def tell(self, text: str) -> None:
        """A sentence for the user, beside the result."""
        tell(self.stderr, text)

    @contextmanager
    def progress(self, text: str, total: int) -> Iterator[Callable[[int], None]]:
        """Yields a function that takes how much of ``total`` is done."""
        with progress_bar(self.stderr, text, total) as progress:
            yield progress

    def rows(self) -> Numbers:
        """The rows that the command line selects; reports damage first."""
        if self.recording.damage:
            self.tell(f"{self.recording.path}: {self.recording.damage}")
        options = self.options
        return Excerpt(options.message, options.start, options.end).rows(self.recording, self.messages)

    def folder(self) -> Path:
        """The output folder; raises NothingSelected for what is none."""
        folder: Path = self.options.output or self.options.file.with_suffix("")
        if folder.exists() and not folder.is_dir():
            raise NothingSelected(f"'{folder}' is not a folder; name one with -o")
        return folder

    def file(self, suffix: str = "") -> Path:
        """The output file; raises NothingSelected for the recording itself, OutputExists for one that stays."""
        output: Path = self.options.output or self.options.file.with_suffix(suffix)
        if output.exists() and output.samefile(self.recording.path):
            raise NothingSelected(f"'{output}' is the recording itself; name another file with -o")
        refuse_existing([output], self.options.force)
        return output


def tell(stderr: TextIO, text: str) -> None:
    """A line for the user."""
    stderr.write(f"dodo rec: {printable(text)}\n")
