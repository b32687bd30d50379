"""Where a run comes from: its command, without secrets, and the commits of its application and tests."""

import argparse
import contextlib
import os
import platform
import shlex
import subprocess
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from dodo_dsl import __version__
from dodo_dsl.report.results import COMMIT, Repository, RunRecord
from dodo_dsl.spec.deployment import Deployment

_VALUES = ("level", "backend", "jobs", "clock", "wall_timeout", "isolation", "seed", "compiled", "application")
"""Options with values that may be noted; whatever is not listed here is left out."""


def command_line(options: argparse.Namespace) -> str:
    """The command that repeats a run of these options; how it is shown, watched and reported is left out."""
    return shlex.join(["dodo", "run", *options.test, *_flags(options)])


def _flags(options: argparse.Namespace) -> Iterator[str]:
    for name in _VALUES:
        given = getattr(options, name)
        values = given if isinstance(given, list) else [] if given is None else [given]
        for value in values:
            yield f"--{name.replace('_', '-')}"
            yield f"{value:g}" if isinstance(value, float) else str(value)
    if options.repeat != 1:
        yield from ("--repeat", str(options.repeat))
    if options.samples:
        yield from ("--samples", str(options.samples))
    if options.retry_errors:
        yield from ("--retry-errors", str(options.retry_errors))
    if options.fail_fast:
        yield "--fail-fast"


_PATIENCE_S = 5.0
_CONFIGURED = ("-c", "core.fsmonitor=false")
"""No program that the repository names is started."""


@dataclass(frozen=True)
class _Asked:
    what: str
    head: "subprocess.Popen[str]"
    status: "subprocess.Popen[str]"


class Asking:
    """Repositories that git is asked about while the run goes on."""

    def __init__(self, asked: list[_Asked]) -> None:
        self._asked = asked

    def answers(self) -> tuple[Repository, ...]:
        """Each repository once, with what is in it; nothing of folders that are in none."""
        found: dict[str, Repository] = {}
        for asked in self._asked:
            top, _, commit = _said(asked.head).partition("\n")
            if not COMMIT.fullmatch(commit := commit.strip()):
                continue
            known = found.get(top)
            what = f"{known.what} and {asked.what}" if known else asked.what
            changed = known.changed if known else bool(_said(asked.status))
            found[top] = Repository(what, commit, changed)
        return tuple(found.values())


@contextlib.contextmanager
def asking(folders: Mapping[str, Path]) -> Iterator[Asking]:
    """Asks git about folders by what is in them; what it has not answered by the end is given up."""
    with contextlib.ExitStack() as stack:
        asked = []
        with contextlib.suppress(OSError):  # there is no git
            for what, folder in folders.items():
                head = stack.enter_context(_git(folder, "rev-parse", "--show-toplevel", "HEAD"))
                status = stack.enter_context(_git(folder, "status", "--porcelain"))
                asked.append(_Asked(what, head, status))
        yield Asking(asked)


@contextlib.contextmanager
def _git(folder: Path, *words: str) -> Iterator["subprocess.Popen[str]"]:
    """In its own session, so that Ctrl-C is not for it."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    process = subprocess.Popen(
        ["git", "--no-optional-locks", *_CONFIGURED, "-C", str(folder), *words],  # noqa: S607
        env={**environment, "LC_ALL": "C"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        encoding="utf-8",
        errors="replace",
        start_new_session=True,
    )
    with process:
        try:
            yield process
        finally:
            process.kill()


def _said(process: "subprocess.Popen[str]") -> str:
    try:
        out, _ = process.communicate(timeout=_PATIENCE_S)
    except subprocess.TimeoutExpired:
        return ""
    return out if process.returncode == 0 else ""


@dataclass(frozen=True)
class Origin:
    """``folders`` are by what is in them."""

    command: str
    folders: Mapping[str, Path] = field(default_factory=dict)


def origin(options: argparse.Namespace, deployment: Deployment) -> Origin:
    """Where a run of these options of ``dodo run`` comes from."""
    files = [] if options.compiled else [*(options.application or deployment.application)]
    application = {"application": files[0].resolve().parent} if files else {}
    return Origin(command_line(options), {**application, "tests": (options.compiled or [deployment.root])[0].resolve()})


@contextlib.contextmanager
def recording(origin: Origin) -> Iterator[Callable[[], RunRecord]]:
    """What makes the record of a run that begins now, at its end."""
    date = datetime.now(UTC).isoformat(timespec="seconds")
    with asking(origin.folders) as repositories:
        yield lambda: RunRecord(date, platform.node(), __version__, origin.command, repositories.answers())
