"""Any rig of a pool: a test takes the one that is free, or waits for the first that comes free."""

import contextlib
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AbstractAsyncContextManager
from pathlib import Path

from dodo_dsl.run import leases
from dodo_dsl.run.backends import Job
from dodo_dsl.run.process.host_isolation import is_claimed
from dodo_dsl.run.protocol import Backend, BackendError, Say
from dodo_dsl.run.rigs.leases import device_leases, devices_of, quarantined
from dodo_dsl.run.rigs.permission import refuse_test
from dodo_dsl.run.rigs.problems import RigProblem

Open = Callable[[Job], AbstractAsyncContextManager[Backend]]


@contextlib.asynccontextmanager
async def opened(job: Job, say: Say, backend_of: Open) -> AsyncIterator[tuple[Job, Backend]]:
    """The job for the rig that it runs on, with its backend; raises BackendError.

    All that the test waits for, it waits for since now, so that no later test overtakes it.
    """
    async with contextlib.AsyncExitStack() as stack:
        with leases.arrived(), contextlib.ExitStack() as tickets:
            chosen = await _chosen(job, say, tickets) if job.others else job
            backend = await stack.enter_async_context(backend_of(chosen))
        yield chosen, backend


async def _chosen(job: Job, say: Say, tickets: contextlib.ExitStack) -> Job:
    """The job for the first rig that is free, which a ticket keeps from others of a pool until its leases are taken."""
    usable = _usable([job, *job.others])
    by_rig = {one.plan.rig: _lease_names(one) for one in usable}
    names = [name for found in by_rig.values() for name in found]
    since = leases.arrival_time()

    def free() -> Job | None:
        return next((one for one in usable if _is_free(by_rig[one.plan.rig], since)), None)

    with leases.ticket(names, since):
        try:
            chosen = await leases.in_turn(free, names, say, False, leases.DEFAULT_PATIENCE_S, since)
        except leases.LeaseTimeout as error:
            raise BackendError(f"none of the rigs {', '.join(by_rig)} came free: {error}") from error
        tickets.enter_context(leases.ticket(by_rig[chosen.plan.rig], since, turn=True))
    say(f"on rig '{chosen.plan.rig}'")
    return chosen


def _lease_names(job: Job) -> list[str]:
    return [f"cid-{job.plan.cid}", *device_leases(devices_of(job.plan))]


def _is_free(names: Sequence[str], since: int) -> bool:
    return not leases.ahead(names, since) and not is_claimed(names[0])


def _usable(jobs: Sequence[Job]) -> list[Job]:
    """The jobs whose rigs this machine has, and may use; raises BackendError if there are none."""
    refusals = {job.plan.rig: _refusal(job) for job in jobs}
    if usable := [job for job in jobs if not refusals[job.plan.rig]]:
        return usable
    said = "; ".join(f"{rig}: {reason}" for rig, reason in refusals.items())
    raise BackendError(f"no rig of the pool can be used here: {said}")


def _refusal(job: Job) -> str:
    """Why a rig cannot be used; empty if it can."""
    devices = devices_of(job.plan)
    absent = [device for device in devices if device.startswith("/") and not Path(device).exists()]
    if absent:
        return f"there is no '{absent[0]}'"
    try:
        refuse_test(job.plan, ())
        reason = quarantined(job.plan.rig, devices)
    except RigProblem as problem:
        return str(problem)
    return f"in quarantine: {reason}" if reason else ""
