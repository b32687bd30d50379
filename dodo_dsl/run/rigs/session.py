"""What the runner does about a real rig during a test: leases, health check and heartbeat."""

import contextlib
from collections.abc import AsyncIterator, Callable
from pathlib import Path

from dodo_dsl.plan.model import Plan, PlannedService
from dodo_dsl.run.announce import heartbeat
from dodo_dsl.run.process.slot import Slot
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.run.rigs.access import query
from dodo_dsl.run.rigs.leases import devices_of, leased, quarantine, quarantined
from dodo_dsl.run.rigs.ports import refuse_shared_port
from dodo_dsl.run.rigs.problems import ProgramTimeout, RigProblem

PATIENCE_S = 90.0
"""s: from the far corner the rig searches its home position for 20 s, and for most of a minute if it repeats that."""
CHECKS = {"gantry": ("services.gantry.manual", "check"), "camera": ("services.camera.health_check",)}
"""By the name of the service: the module that checks its hardware by the service's flags, and its action."""


async def examine(plan: Plan, say: Callable[[str], None], descriptors: tuple[int, ...]) -> None:
    """Checks the real rig of a test, under its leases; one that fails goes into quarantine. Raises BackendError."""
    try:
        devices = devices_of(plan)
        reason = quarantined(plan.rig, devices)
        if not reason:
            say(f"checking rig '{plan.rig}'")
            reason = await _failure(plan, descriptors)
            if reason:
                quarantine(plan.rig, reason, devices)
    except RigProblem as problem:
        raise BackendError(f"rig '{plan.rig}' cannot be checked: {problem}") from problem
    if reason:
        raise BackendError(f"rig '{plan.rig}' is in quarantine: {reason} ('dodo rig clear {plan.rig}' ends it)")


async def _failure(plan: Plan, descriptors: tuple[int, ...]) -> str:
    """Why the rig's gantry or camera is unfit; empty when both are fit. Raises RigProblem."""
    for service in plan.services:
        module, *action = CHECKS.get(service.uses, ("",))
        if not module or _reads_a_file(service):
            continue
        flags = (flag for flag in service.flags if flag.kind == "text" and flag.name != "cid")
        words = [f"--{flag.name}={flag.value}" for flag in flags]
        try:
            answer = await query(("python", "-m", module), [*words, *action], PATIENCE_S, descriptors)
        except ProgramTimeout as timeout:
            return f"its health check hung: {timeout}"
        if not answer.get("ok"):
            return str(answer.get("reason") or "its health check failed")
    return ""


def _reads_a_file(service: PlannedService) -> bool:
    return any(flag.kind == "path" and flag.name == "file" for flag in service.flags)


@contextlib.asynccontextmanager
async def attended(
    plan: Plan,
    slot: Slot,
    say: Callable[[str], None],
) -> AsyncIterator[tuple[int, ...]]:
    """Leases and checks a real rig, with a heartbeat, within the block; gives all descriptors. Raises BackendError."""
    if not plan.is_real:
        yield slot.descriptors
        return
    async with contextlib.AsyncExitStack() as stack:
        refuse_shared_port(plan)
        more = await stack.enter_async_context(leased(None, plan.slug, say, devices=devices_of(plan)))
        await examine(plan, say, (*slot.descriptors, *more))
        await stack.enter_async_context(heartbeat(slot.cid, Path(slot.channel)))
        yield (*slot.descriptors, *more)
