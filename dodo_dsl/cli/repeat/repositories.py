"""The commits of the git repositories that a run's application and tests are in."""

import contextlib
import os
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.report.run_record import COMMIT, Repository

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
    """In a session of its own, so that Ctrl-C is not for it."""
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
