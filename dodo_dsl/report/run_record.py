"""When, where and of what a run was, and how to repeat it."""

import re
from dataclasses import dataclass

COMMIT = re.compile(r"[0-9a-f]{40}|[0-9a-f]{64}")
_SHOWN = 12


@dataclass(frozen=True)
class Repository:
    """A git repository at a commit; ``what`` is in it, the application or the tests.

    ``changed`` tells whether it had changes or files that were in no commit.
    """

    what: str
    commit: str
    changed: bool

    def in_words(self) -> str:
        return f"{self.what} at commit {self.commit[:_SHOWN]}" + (" with uncommitted changes" if self.changed else "")


@dataclass(frozen=True)
class RunRecord:
    """``date`` is ISO 8601 in UTC, ``dodo`` the version, ``command`` without what may be secret."""

    date: str
    host: str
    dodo: str
    command: str
    repositories: tuple[Repository, ...] = ()

    def in_words(self) -> str:
        """All but the command."""
        date = self.date[:16].replace("T", " ")
        return ", ".join(
            [f"{date} UTC on {self.host} with DoDo {self.dodo}", *(r.in_words() for r in self.repositories)]
        )
