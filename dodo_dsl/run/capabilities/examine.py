"""All findings about this machine, and the removal of what killed runs left."""

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

from dodo_dsl.run import history, leases
from dodo_dsl.run.capabilities import kernel, programs
from dodo_dsl.run.capabilities.finding import Capability
from dodo_dsl.run.docker import cleanup
from dodo_dsl.run.docker.client import connect
from dodo_dsl.run.process import leftovers
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.run.rigs.quarantine import all_quarantined
from dodo_dsl.state_folder import NoStateFolder, state_path


def examine() -> list[Capability]:
    """All findings, in the order in which a run would need things."""
    return [finding for check in CHECKS for finding in _findings(check)]


def _findings(check: Callable[[], Iterator[Capability]]) -> Iterator[Capability]:
    """The findings of a check; a check that raises is a finding, too."""
    try:
        yield from check()
    except Exception as error:  # noqa: BLE001  (a machine that lacks something is what this command is for)
        yield Capability(check.__name__.replace("_", " "), "problem", f"cannot be examined: {error}")


def left_behind() -> Iterator[Capability]:
    """What killed runs left."""
    left = [f"test {about.get('test', '?')}" for prefix in ("cid-", leases.PROJECT) for about in _orphans(prefix)]
    if left:
        yield Capability("left behind", "warning", f"by killed runs: {', '.join(left)}", "dodo doctor --clean")
    else:
        yield Capability("left behind", "ok", "nothing of killed runs")


def _orphans(prefix: str) -> Iterator[dict[str, Any]]:
    for lease, about in leases.orphans(prefix):
        yield about
        lease.leave()


def state_folder() -> Iterator[Capability]:
    """Whether this user's state can be kept."""
    try:
        state_path(history.PATH_VARIABLE, "history.jsonl")
    except NoStateFolder as problem:
        yield Capability(
            "state folder", "warning", str(problem), "without it there is no forecast of how long tests take"
        )


def rigs() -> Iterator[Capability]:
    """The rigs in quarantine."""
    try:
        for rig, reason in all_quarantined().items():
            yield Capability(
                f"rig {rig}", "problem", f"in quarantine: {reason}", f"repair it, then dodo rig clear {rig}"
            )
    except RigProblem as problem:
        yield Capability("rigs", "warning", str(problem), "tests on real rigs end in error without it")


CHECKS: tuple[Callable[[], Iterator[Capability]], ...] = (
    kernel.namespaces,
    kernel.multicast,
    kernel.receive_buffer,
    kernel.shared_memory,
    kernel.disk,
    programs.docker_engine,
    programs.compose,
    left_behind,
    state_folder,
    rigs,
    programs.emulated_rig,
)


def clean() -> cleanup.Reaped:
    """Removes what killed runs left, as the next run would; returns what was removed, and what could not be."""
    on_host = leftovers.reap()
    try:
        client = connect()
    except BackendError:
        return cleanup.Reaped(on_host)
    with contextlib.closing(client):
        reaped = cleanup.reap_projects(client)
    return cleanup.Reaped([*on_host, *reaped.removed], reaped.left)
