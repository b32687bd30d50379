"""How long tests took on this machine, and what their checks measured, kept over runs: for forecasts and the report."""

import contextlib
import json
import os
import re
import statistics
import subprocess
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import msgspec

from dodo_dsl import atomic
from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import Outcome
from dodo_dsl.spec.deployment import FILE_NAME
from dodo_dsl.state_folder import NoStateFolder, state_path

_MAX_BYTES = 4_000_000
_RECENT = 5
_SHOWN = 20
PATH_VARIABLE = "DODO_HISTORY"


@dataclass(frozen=True)
class PastRun:
    """A test that ran to its end; ``when`` in s since the epoch, times in s."""

    when: int
    spec: str
    test: str
    level: str
    backend: str
    clock: str
    outcome: str
    setup_s: float
    execution_s: float
    checks: Mapping[str, float] = field(default_factory=dict)
    """Values by name, of names that one check has."""
    repository: str = ""
    """The repository that it is a test of: its address, or else its folder."""


def default_path() -> Path:
    """``DODO_HISTORY``, else a file in this user's state folder; the null device for a user without a home folder."""
    try:
        return state_path(PATH_VARIABLE, "history.jsonl")
    except NoStateFolder:
        return Path(os.devnull)


def _repository() -> str:
    """The address of this git repository, wherever it is cloned; else the folder with ``dodo.yml``, or this one."""
    command = ["git", "--no-optional-locks", "-c", "core.fsmonitor=false", "config", "--get", "remote.origin.url"]
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        found = subprocess.run(command, capture_output=True, timeout=5, check=True).stdout.decode(errors="replace")
        return re.sub(r"(?<=://)[^/@]*@", "", found.strip())  # without a token
    here = Path.cwd()
    return str(next((folder for folder in (here, *here.parents) if (folder / FILE_NAME).exists()), here))


class History:
    """The ``runs`` in this repository, of a file with a line of JSON each, as far as it can be read and written."""

    def __init__(self, path: Path | None = None, clock: Callable[[], float] = time.time) -> None:
        """``clock`` gives seconds since the epoch."""
        self.path = path or default_path()
        self._clock = clock
        self._repository = _repository()
        self.runs: list[PastRun] = []
        self._of: defaultdict[tuple[str, str], list[PastRun]] = defaultdict(list)
        self._take(run for run in _read(self.path) if run.repository == self._repository)
        self._saved = len(self.runs)

    def _take(self, runs: Iterable[PastRun]) -> None:
        for run in runs:
            self.runs.append(run)
            self._of[run.spec, run.test].append(run)

    def _alike(self, spec: str, test: str, backend: str, clock: str) -> list[PastRun]:
        return [run for run in self._of[spec, test] if (run.backend, run.clock) == (backend, clock)]

    def seconds(self, spec: str, test: str, backend: str, clock: str) -> float | None:
        """The median time of the latest runs, from the start of set-up to the end; None when the test never ran."""
        took = [run.setup_s + run.execution_s for run in self._alike(spec, test, backend, clock)[-_RECENT:]]
        return statistics.median(took) if took else None

    def checks(self, spec: str, test: str, backend: str, clock: str) -> list[dict[str, Any]]:
        """The latest runs of a test: when they ended, with what, and their checks' values."""
        runs = [run for run in self._alike(spec, test, backend, clock) if run.checks]
        return [{"when": r.when, "outcome": r.outcome, "checks": dict(r.checks)} for r in runs[-_SHOWN:]]

    def add(self, outcomes: Iterable[tuple[str, Outcome]]) -> None:
        """Adds pairs of a test's name and its outcome; errors are left out, because they say nothing about its time."""
        self._take(
            PastRun(
                int(self._clock()), o.spec, test, o.level, o.backend, o.clock, o.outcome, o.setup_s, o.execution_s,
                _values(o.checks), self._repository,
            )
            for test, o in outcomes
            if o.outcome != "error" and o.setup_s is not None and o.execution_s is not None
        )  # fmt: skip

    def save(self) -> None:
        """Appends to the file what was added since it was read."""
        text = "".join(json.dumps(asdict(run)) + "\n" for run in self.runs[self._saved :])
        self._saved = len(self.runs)
        with contextlib.suppress(OSError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if self.path.is_file() and self.path.stat().st_size > _MAX_BYTES:
                self._shorten()
            with atomic.appended(self.path) as file:
                file.write(text.encode())

    def _shorten(self) -> None:
        lines = self.path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)
        atomic.write_text(self.path, "".join(lines[len(lines) // 2 :]))


def _values(checks: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    names = Counter(check["name"] for check in checks)
    return {c["name"]: c["value"] for c in checks if names[c["name"]] == 1 and c["value"] is not None}


def _read(path: Path) -> Iterator[PastRun]:
    """The valid lines: those that a killed run left unfinished are skipped."""
    with contextlib.suppress(OSError):
        yield from filter(None, map(_past_run, regular_file.content(path).splitlines()))


def _past_run(line: bytes) -> PastRun | None:
    with contextlib.suppress(msgspec.DecodeError):
        run = msgspec.json.decode(line, type=PastRun)
        if min(run.setup_s, run.execution_s) >= 0:
            return run
    return None
