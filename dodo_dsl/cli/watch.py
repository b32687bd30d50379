"""dodo run --watch: compile and run again, in lockstep, what a saved file affects.

Which files are saved is found by looking at their times: the same on every file system. Editors replace files, write
next to them and rename, and network file systems and containers notify nobody, so nothing waits for the
kernel's notices. Looking at a thousand files takes some milliseconds.
"""

import argparse
import contextlib
import hashlib
import os
import time
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import TextIO

from dodo_dsl.check import forget_files
from dodo_dsl.cli import run as cli_run
from dodo_dsl.cli.errors import UsageError, of_outcomes
from dodo_dsl.cli.loading import loading
from dodo_dsl.cli.provenance import origin
from dodo_dsl.cli.run_jobs import prepare
from dodo_dsl.compiler import NoApplication
from dodo_dsl.outcome import Outcome
from dodo_dsl.report.comparison import change_lines, compare
from dodo_dsl.report.results import GivenReport
from dodo_dsl.run.backends import Job
from dodo_dsl.run.work_folder import WorkFolder, work_folder
from dodo_dsl.spec.deployment import Deployment, find_deployment, load_deployment
from dodo_dsl.spec.model import LOCKSTEP
from dodo_dsl.terminal import printable

MOST_FILES = 20_000
"""Further ones are not looked at."""
_SKIPPED = {"__pycache__", "node_modules"}

Seen = dict[Path, tuple[int, int]]
"""Time of change in ns and size in bytes of each file."""


def seen(roots: Iterable[Path], skipped: Collection[Path]) -> Seen:
    """The files below the roots but for hidden ones, and those below folders of ``skipped``. All paths are resolved."""
    found: Seen = {}
    for root in roots:
        for place, folders, names in os.walk(root):
            here = Path(place)
            folders[:] = [n for n in folders if n[0] != "." and n not in _SKIPPED and here / n not in skipped]
            for name in (name for name in names if name[0] != "." and name[-1] != "~"):
                if len(found) == MOST_FILES:
                    return found
                with contextlib.suppress(OSError):  # it is gone
                    status = (here / name).stat()
                    found[here / name] = status.st_mtime_ns, status.st_size
    return found


def saved(before: Seen, after: Seen) -> set[Path]:
    """Files that are new, changed or gone."""
    return {path for path in {*before, *after} if before.get(path) != after.get(path)}


LOOK_S = 0.3
"""Between two looks at the files; what is saved has to stay the same for one, as editors write in steps."""
BEFORE = Path("the run before")


def main(options: argparse.Namespace, stdout: TextIO) -> int:
    """Until Ctrl-C; the exit code is that of the latest outcomes."""
    for name in ("compiled", "keep"):
        if getattr(options, name):
            raise UsageError(f"--watch and --{name} do not go together")
    options.clock = options.clock or LOCKSTEP
    with work_folder() as folder:
        watch = Watch(options, folder, stdout)
        try:
            files = watch.look()
            is_over = watch.run(None)
            while not is_over:
                files, changed = watch.wait(files)
                is_over = watch.run(changed)
        except KeyboardInterrupt:
            stdout.write("\n")
    return of_outcomes(outcome.outcome for outcome in watch.outcomes.values())


class Watch:
    """The tests of a command line with their latest ``outcomes`` by slug."""

    def __init__(self, options: argparse.Namespace, folder: WorkFolder, stdout: TextIO) -> None:
        self.outcomes: dict[str, Outcome] = {}
        self._options, self._folder, self._stdout = options, folder, stdout
        self._compiled: dict[str, bytes] = {}
        self._changed: set[Path] = set()
        """Since tests could be compiled last."""

    def look(self) -> Seen:
        """The files that tests may depend on, as they are now."""
        deployment = _deployment(self._options.test)
        named = [path for word in self._options.test if (path := Path(word)).exists()]
        folders = [*deployment.registry, *self._folders(deployment), deployment.root, *named]
        roots = [folder.resolve() if folder.is_dir() else folder.resolve().parent for folder in folders]
        return seen(dict.fromkeys(roots), {self._options.report.resolve(), Path("generated").resolve()})

    def wait(self, before: Seen) -> tuple[Seen, set[Path]]:
        """The files after something was saved, and what it was."""
        self._stdout.write("waiting for a file to be saved; Ctrl-C ends\n")
        self._stdout.flush()
        latest = before
        while True:
            time.sleep(LOOK_S)
            now = self.look()
            if now == latest and (changed := saved(before, now)):
                return now, changed
            latest = now

    def run(self, changed: Collection[Path] | None) -> bool:
        """Runs what the changed files affect, all tests for None; returns whether it was interrupted."""
        self._changed |= {*(changed or ())}
        with loading(self._options) as server:
            forget_files()
            try:
                jobs, deployment = prepare(self._options, self._folder.path, self._stdout)
            except (UsageError, NoApplication) as problem:
                if changed is None:
                    raise
                self._stdout.write(f"{problem}\n")
                return False
            names = _names(self._changed)
            chosen = self._affected(jobs, deployment)
            self._changed.clear()
            if not chosen:
                self._stdout.write(f"no test is affected by {names}\n")
                return False
            if changed:
                self._stdout.write(f"saved: {names}\n")
            runner = cli_run.runner_of(self._options, chosen, deployment, self._stdout, self._folder, server)
            slugs = {job.plan.slug for job in jobs} - {job.plan.slug for job in chosen}
            others = [outcome for slug, outcome in self.outcomes.items() if slug in slugs]
            kept = GivenReport(BEFORE, others) if others else None
            report, said = self._options.report, self._options.verbosity
            source = origin(self._options, deployment)
            outcomes, _, _ = cli_run.run(runner, chosen, report, self._stdout, source, kept, said)
        self._show_change(outcomes)
        self.outcomes = {outcome.slug: outcome for outcome in [*others, *outcomes]}
        return runner.interrupted

    def _affected(self, jobs: Sequence[Job], deployment: Deployment) -> list[Job]:
        """Tests that are compiled otherwise than before, and all where a program of theirs was saved."""
        before, self._compiled = self._compiled, {job.plan.slug: _digest(job.folder) for job in jobs}
        for job in jobs:
            if job.plan.is_real:
                raise UsageError(f"{job.plan.name} runs on rig '{job.plan.rig}', which --watch does not set in motion")
        registries = [folder.resolve() for folder in deployment.registry]
        programs = [folder.resolve() for folder in self._folders(deployment)]
        is_program = any(_is_in(path, programs) and not _is_in(path, registries) for path in self._changed)
        same = {slug for slug, digest in self._compiled.items() if slug in self.outcomes and before.get(slug) == digest}
        return [job for job in jobs if is_program or job.plan.slug not in same]

    def _folders(self, deployment: Deployment) -> list[Path]:
        """Those of the application and of the deployment's own services."""
        files = self._options.application or deployment.application
        return [*(file.parent for file in files), *deployment.services]

    def _show_change(self, outcomes: Sequence[Outcome]) -> None:
        before = [self.outcomes[outcome.slug] for outcome in outcomes if outcome.slug in self.outcomes]
        if before:
            comparison = compare(outcomes, GivenReport(BEFORE, before))
            self._stdout.writelines(f"{line}\n" for line in change_lines(comparison))


def _deployment(words: Sequence[str]) -> Deployment:
    return load_deployment(find_deployment(Path.cwd(), [path for path in map(Path, words) if path.exists()]))[0]


def _is_in(path: Path, folders: Collection[Path]) -> bool:
    return any(path.is_relative_to(folder) for folder in folders)


def _names(changed: Collection[Path]) -> str:
    here = Path.cwd().resolve()
    names = sorted(os.path.relpath(path, here) for path in changed)
    return printable(", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else ""))


def _digest(folder: Path) -> bytes:
    """Of all files of a compiled test, with their names."""
    digest = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        data = path.read_bytes()
        digest.update(f"{path.relative_to(folder)}\0{len(data)}\0".encode())
        digest.update(data)
    return digest.digest()
