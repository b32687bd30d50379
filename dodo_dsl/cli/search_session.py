"""A session of ``dodo search`` or ``dodo tune``."""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO, cast

from dodo_dsl import compiler
from dodo_dsl.cli import selection
from dodo_dsl.cli.display import write_diagnostics
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.loading import loading
from dodo_dsl.cli.numbers import positive, seed
from dodo_dsl.cli.progress import NoProgress
from dodo_dsl.cli.report import REPORT
from dodo_dsl.cli.uninterrupted import UninterruptedStream, more_descriptors
from dodo_dsl.diagnostics import has_errors, ordered
from dodo_dsl.run.backends import CombinedBackends
from dodo_dsl.run.process.fork_server import ForkServer
from dodo_dsl.run.schedule import Schedule
from dodo_dsl.run.work_folder import WorkFolder, reap_folders, work_folder
from dodo_dsl.search.drives import Drives, end_like_interrupt
from dodo_dsl.search.store import Store
from dodo_dsl.search.study import Study
from dodo_dsl.spec.load import Settings
from dodo_dsl.spec.model import LOCKSTEP
from dodo_dsl.terminal import printable

INTERRUPTED = "interrupted: the same command goes on from here\n"


def add_common(parser: argparse.ArgumentParser, place: str) -> None:
    """What both commands have; ``place`` is where their results are."""
    parser.add_argument("--seed", type=seed, default=0, metavar="S", help="seed of all values (default: 0)")
    parser.add_argument(
        "-j", "--jobs", type=positive, metavar="N", help="concurrent drives (default: as many as the cores allow)"
    )
    parser.add_argument("--isolation", choices=("network", "host"), help="override the specs' isolation")
    parser.add_argument(
        "--report", type=Path, default=REPORT, metavar="DIR", help=f"store the result in {place} (default: dodo-report)"
    )
    selection.add_application(parser)


@dataclass(frozen=True)
class SearchSession:
    """One ``dodo search`` or ``dodo tune``; ``folder`` takes what it compiles, and ``stdout`` may lose its reader."""

    options: argparse.Namespace
    stdout: TextIO
    folder: WorkFolder
    server: ForkServer | None

    def selected(self, words: Sequence[str]) -> compiler.Checked:
        """The tests that the words mean."""
        options = self.options
        return selection.select(words, (), options.application, Settings(LOCKSTEP, options.isolation))

    def compiled(self, checked: compiler.Checked) -> compiler.Compilation:
        """The tests at their nominal values, with their problems shown; raises UsageError if some are errors."""
        made = compiler.plan(checked, checked.deployment.root / "nominal") if checked.ok else None
        problems = ordered([*checked.diagnostics, *(made.problems if made else ())])
        write_diagnostics(self.stdout, problems)
        if made is None or has_errors(problems):
            raise UsageError("the above cannot be compiled")
        return made

    def drives(self, study: Study, store: Store, folder: Path, shared: bool = False) -> Drives:
        """Drives by processes."""
        deployment, options = study.checked.deployment, self.options
        backends = CombinedBackends(
            "process", deployment.cids, isolation=options.isolation,
            descriptors=(self.folder.lease.descriptor,), fork_server=self.server,
        )  # fmt: skip
        order = Schedule(options.jobs)
        progress = _Lines(self.stdout)
        return Drives(study.checked, store, backends, order, self.folder.path, progress, folder, shared)


@contextmanager
def session(options: argparse.Namespace, stdout: TextIO) -> Iterator[SearchSession]:
    end_like_interrupt()
    more_descriptors()
    reap_folders()
    options.backend = "process"
    with work_folder() as folder, loading(options) as server:
        yield SearchSession(options, cast(TextIO, UninterruptedStream(stdout)), folder, server)


class _Lines(NoProgress):
    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def note(self, text: str) -> None:
        self._stream.write(f"{printable(text)}\n")
        self._stream.flush()
