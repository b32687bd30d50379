"""How long tests took on this machine and what became of them, kept over runs: for their order and the report."""

import contextlib
import os
import re
import statistics
import subprocess
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import msgspec

from dodo_dsl import atomic
from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import Outcome
from dodo_dsl.spec.deployment import FILE_NAME
from dodo_dsl.state_folder import NoStateFolder, state_path

_MAX_BYTES = 4_000_000
_RECENT = 5


class PastRun(msgspec.Struct, frozen=True):
    """A test that ran to its end; ``when`` in s since the epoch, times in s.

    ``repository`` is the address of that which it is a test of, or else its folder.
    """

    when: int
    spec: str
    test: str
    backend: str
    clock: str
    outcome: str
    setup_s: float
    execution_s: float
    repository: str = ""

    def in_words(self) -> str:
        date = time.strftime("%Y-%m-%d %H:%M", time.gmtime(self.when))
        return f"{self.outcome} after {self.setup_s + self.execution_s:.1f} s, {date} UTC"


class History:
    """The runs in this repository, of a file with a line of JSON each, as far as it can be read and written."""

    def __init__(self) -> None:
        self.path = Path(os.devnull)
        with contextlib.suppress(NoStateFolder):
            self.path = state_path("DODO_HISTORY", "history.jsonl")
        self._repository = _repository()
        self._runs = [run for run in _read(self.path) if run.repository == self._repository]

    def of(self, spec: str, test: str, backend: str, clock: str) -> list[PastRun]:
        key = (spec, test, backend, clock)
        return [run for run in self._runs if (run.spec, run.test, run.backend, run.clock) == key]

    def add(self, outcomes: Iterable[tuple[str, Outcome]]) -> None:
        """Adds pairs of a test's name and its outcome; errors are left out, because they say nothing about its time."""
        when = int(time.time())
        added = [
            PastRun(when, o.spec, test, o.backend, o.clock, o.outcome, o.setup_s, o.execution_s, self._repository)
            for test, o in outcomes
            if o.outcome != "error" and o.setup_s is not None and o.execution_s is not None
        ]
        self._runs += added
        with contextlib.suppress(OSError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if self.path.is_file() and self.path.stat().st_size > _MAX_BYTES:
                lines = regular_file.content(self.path).splitlines(keepends=True)
                atomic.write_bytes(self.path, b"".join(lines[len(lines) // 2 :]))
            with atomic.appended(self.path) as file:
                file.write(msgspec.json.Encoder().encode_lines(added))


def typical_s(runs: Sequence[PastRun]) -> float | None:
    """The median time of the latest runs, from the start of set-up to the end; None without one."""
    took = [run.setup_s + run.execution_s for run in runs[-_RECENT:]]
    return statistics.median(took) if took else None


def _repository() -> str:
    """The address of this git repository, wherever it is cloned; else the folder with ``dodo.yml``, or this one."""
    command = ["git", "--no-optional-locks", "-c", "core.fsmonitor=false", "config", "--get", "remote.origin.url"]
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        found = subprocess.run(command, capture_output=True, timeout=5, check=True).stdout.decode(errors="replace")
        return re.sub(r"(?<=://)[^/@]*@", "", found.strip())  # without a token
    here = Path.cwd()
    return str(next((folder for folder in (here, *here.parents) if (folder / FILE_NAME).exists()), here))


def _read(path: Path) -> Iterator[PastRun]:
    """The valid lines: those that a killed run left unfinished are skipped."""
    with contextlib.suppress(OSError):
        for line in regular_file.content(path).splitlines():
            with contextlib.suppress(msgspec.DecodeError, RecursionError):
                run = msgspec.json.decode(line, type=PastRun)
                if min(run.setup_s, run.execution_s) >= 0:
                    yield run
