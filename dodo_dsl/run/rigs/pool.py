"""Any rig of a pool: a test takes the one that is free, or waits for the first that comes free."""

import contextlib
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from typing import Any

from dodo_dsl.run import leases
from dodo_dsl.run.backends import Job
from dodo_dsl.run.protocol import BackendError, Say
from dodo_dsl.run.rigs.leases import device_keys, devices_of, quarantined
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.run.sides import Backend

Open = Callable[[Job], AbstractAsyncContextManager[Backend]]


@contextlib.asynccontextmanager
async def opened(job: Job, say: Say, backend_of: Open) -> AsyncIterator[tuple[Job, Backend]]:
    """The job for the rig that it runs on, with its backend; raises BackendError."""
    async with contextlib.AsyncExitStack() as stack:
        chosen = await _chosen(job, say, stack) if job.others else job
        yield chosen, await stack.enter_async_context(backend_of(chosen))


async def _chosen(job: Job, say: Say, stack: contextlib.AsyncExitStack) -> Job:
    """The job for the first rig that is free, which no other test of a pool chooses until the ``stack`` is left."""
    usable = {f"rig-{one.plan.rig}": one for one in _usable([job, *job.others])}

    def attempt(name: str, about: dict[str, Any], shared: bool) -> leases.Lease | None:
        cid, *devices = f"cid-{usable[name].plan.cid}", *device_keys(devices_of(usable[name].plan))
        is_free = not any(map(leases.holder, (cid, *devices)))
        return leases.try_lease(name, about, shared) if is_free else None

    try:
        patience_s = leases.DEFAULT_PATIENCE_S
        lease = await leases.lease_any([*usable], {"test": job.plan.slug}, say, patience_s=patience_s, attempt=attempt)
    except leases.LeaseTimeout as error:
        rigs = ", ".join(one.plan.rig for one in usable.values())
        raise BackendError(f"none of the rigs {rigs} came free: {error}") from error
    stack.callback(lease.release)
    chosen = usable[lease.name]
    say(f"on rig '{chosen.plan.rig}'")
    return chosen


def _usable(jobs: Sequence[Job]) -> list[Job]:
    """The jobs whose rigs this machine has, and may use; raises BackendError if there are none."""
    refusals = {job.plan.rig: _refusal(job) for job in jobs}
    if usable := [job for job in jobs if not refusals[job.plan.rig]]:
        return usable
    said = "; ".join(f"{rig}: {reason}" for rig, reason in refusals.items())
    raise BackendError(f"no rig of the pool can be used here: {said}")


def _refusal(job: Job) -> str:
    devices = devices_of(job.plan)
    absent = [device for device in devices if device.startswith("/") and not Path(device).exists()]
    if absent:
        return f"there is no '{absent[0]}'"
    try:
        reason = quarantined(job.plan.rig, devices)
    except RigProblem as problem:
        return str(problem)
    return f"in quarantine: {reason}" if reason else ""
