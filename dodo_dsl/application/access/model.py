"""What an application may use of its host, and what was found that it may not."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from dodo_dsl.application.access.compose_keys import Rows
from dodo_dsl.diagnostics import Fix, did_you_mean, only_fix

Steps = tuple[str | int, ...]
Kind = Literal["refused", "unknown", "hardware", "privilege", "port", "limit", "left out"]


@dataclass(frozen=True)
class Access:
    """What a test's application may use of its host.

    ``roots`` are folders whose files are the application's own, beside those of its repository, ``paths`` others that
    it may mount, ``passed`` variables of DoDo's own environment. ``outside`` tells whether it may reach other networks,
    ``devices`` and ``privileged`` what its rig allows. ``ports`` are those of the deployment's rigs: it gets none.
    """

    roots: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()
    passed: tuple[str, ...] = ()
    outside: bool = False
    devices: bool = False
    privileged: bool = False
    ports: tuple[str, ...] = ()


@dataclass(frozen=True)
class AccessFinding:
    """A key or value that a test may not have; ``steps`` lead to it from where the search began.

    ``hardware`` and ``privilege`` stay on rigs that allow them; they, a rig's ``port`` and what is ``left out`` are not
    in the copy, which has the test's own ``limit``.
    """

    steps: Steps
    message: str
    hint: str = ""
    kind: Kind = "refused"
    fix: Fix | None = None

    def below(self, *steps: str | int) -> "AccessFinding":
        return AccessFinding((*steps, *self.steps), self.message, self.hint, self.kind, self.fix)


def key_findings(what: str, rows: Rows, written: Mapping[str, Any], compiled: bool = False) -> Iterator[AccessFinding]:
    """Keys without a row, and those that are refused; in a ``compiled`` file also those that are removed."""
    for key, value in written.items():
        if str(key).startswith("x-"):
            continue
        if key not in rows:
            hint, fix = did_you_mean(str(key), rows), only_fix(str(key), rows, written)
            yield AccessFinding((key,), f"unknown key '{key}' in {what}", hint, "unknown", fix)
            continue
        treatment, why = rows[key]
        if value in (None, False, "", "false", [], {}):
            continue
        if treatment == "refused" or (compiled and treatment == "removed"):
            yield AccessFinding((key,), f"'{key}' of {what} cannot be isolated: {why}", "remove it")
