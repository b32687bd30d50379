"""Where a run comes from: its command, without secrets, and the commits of its application and tests."""

import argparse
import contextlib
import os
import platform
import shlex
import subprocess
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from dodo_dsl import __version__
from dodo_dsl.report.results import COMMIT, Repository, RunRecord
from dodo_dsl.spec.deployment import Deployment

_OPTIONS: Mapping[str, object] = {
    **dict.fromkeys(("level", "backend", "jobs", "clock", "wall_timeout", "isolation", "seed", "compiled")),
    **{"application": None, "repeat": 1, "samples": 0, "retry_errors": 0, "fail_fast": False},
}
"""Options that may be noted, with what they are by default; whatever is not listed here is left out."""


def command_line(options: argparse.Namespace) -> str:
    """The command that repeats a run of these options; how it is shown, watched and reported is left out."""
    words = ["dodo", "run", *options.test]
    for name, default in _OPTIONS.items():
        given = getattr(options, name)
        for value in given if isinstance(given, list) else [given]:
            if value not in (default, None):
                words.append(f"--{name.replace('_', '-')}")
                words += [] if value is True else [f"{value:g}" if isinstance(value, float) else str(value)]
    return shlex.join(words)


_PATIENCE_S = 5.0
_CONFIGURED = ("-c", "core.fsmonitor=false")
"""No program that the repository names is started."""


def repositories(folders: Mapping[str, Path]) -> tuple[Repository, ...]:
    """The repositories that have the folders, by what is in them: each once."""
    found: dict[str, Repository] = {}
    for what, folder in folders.items():
        top, _, commit = _git(folder, "rev-parse", "--show-toplevel", "HEAD").partition("\n")
        if known := found.get(top):
            found[top] = replace(known, what=f"{known.what} and {what}")
        elif COMMIT.fullmatch(commit := commit.strip()):
            found[top] = Repository(what, commit, bool(_git(folder, "status", "--porcelain")))
    return tuple(found.values())


def _git(folder: Path, *words: str) -> str:
    """What git says; empty where it has no answer. It is in its own session, as Ctrl-C is not for it."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    try:
        done = subprocess.run(
            ["git", "--no-optional-locks", *_CONFIGURED, "-C", str(folder), *words],  # noqa: S607
            env={**environment, "LC_ALL": "C"},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            start_new_session=True,
            timeout=_PATIENCE_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout if done.returncode == 0 else ""


class Origin(NamedTuple):
    """What repeats a run, and the folders that it is of, by what is in them."""

    command: str
    folders: Mapping[str, Path]


def origin(options: argparse.Namespace, deployment: Deployment) -> Origin:
    """Where a run of these options of ``dodo run`` comes from."""
    files = [] if options.compiled else [*(options.application or deployment.application)]
    application = {"application": files[0].resolve().parent} if files else {}
    return Origin(command_line(options), {**application, "tests": (options.compiled or [deployment.root])[0].resolve()})


@contextlib.contextmanager
def recording(origin: Origin) -> Iterator[Callable[[], RunRecord]]:
    """What makes the record of a run that begins now, at its end."""
    date = datetime.now(UTC).isoformat(timespec="seconds")
    with ThreadPoolExecutor(1) as beside:
        asked = beside.submit(repositories, origin.folders)
        yield lambda: RunRecord(date, platform.node(), __version__, origin.command, asked.result())
