"""What the runner does about a real rig during a test: leases, health check and heartbeat."""

import contextlib
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from dodo_dsl.plan.model import Plan
from dodo_dsl.run import leases
from dodo_dsl.run.process.slot import Slot
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.run.rigs.health_check import examine, refuse_quarantined
from dodo_dsl.run.rigs.permission import refuse_test, refuse_unattended
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.run.rigs.rig_leases import devices_in, leased
from dodo_dsl.run.services.announce import heartbeat
from dodo_dsl.spec.deployment.rig import EMULATED_RIGS

GANTRY, CALIBRATE = "gantry", "calibrate"


@dataclass
class RigSession:
    """What holds from test to test of one command: ``fit`` rigs passed their check, and their last test was judged.

    Who knows the outcome of a test adds its rig; it is taken out as soon as the next one begins. A fit rig is not
    checked again, and has found its home.
    """

    fit: set[str] = field(default_factory=set)

    def at_home(self, plan: Plan) -> Plan:
        """The Plan without a calibration that is not needed."""
        if plan.rig not in self.fit:
            return plan
        services = (
            replace(service, flags=tuple(flag for flag in service.flags if flag.name != CALIBRATE))
            if service.uses == GANTRY
            else service
            for service in plan.services
        )
        return replace(plan, services=tuple(services))


def is_real(plan: Plan) -> bool:
    """Whether a test runs on hardware, which has a CID of its own."""
    return bool(plan.rig) and plan.rig not in EMULATED_RIGS


def refuse_hardware(plan: Plan) -> None:
    """Raises BackendError for a test without a rig that would move hardware, which nothing leases or checks."""
    try:
        refuse_unattended(plan)
    except RigProblem as problem:
        raise BackendError(str(problem)) from problem


@contextlib.asynccontextmanager
async def attended(
    plan: Plan,
    slot: Slot,
    say: Callable[[str], None],
    roots: Sequence[Path] = (),
    session: RigSession | None = None,
) -> AsyncIterator[tuple[int, ...]]:
    """Leases and checks a real rig's devices, and sends a heartbeat within the block; does nothing for other tests.

    Gives all descriptors by which a program holds the rig, with those of the ``slot``. ``roots`` are the folders of the
    test's repository, whose tests the machine's operator may not let use it. A rig that is fit in the ``session`` is
    not checked. Raises BackendError then, and when the rig is in use, in quarantine, or fails its health check.
    """
    if not is_real(plan):
        yield slot.descriptors
        return
    devices = devices_in(f"--{flag.name}={flag.value}" for service in plan.services for flag in service.flags)
    async with contextlib.AsyncExitStack() as stack:
        try:
            refuse_test(plan, roots)
        except RigProblem as problem:
            raise BackendError(str(problem)) from problem
        try:
            more = await stack.enter_async_context(leased(None, plan.slug, say, devices=devices))
        except leases.LeaseTimeout as error:
            raise BackendError(str(error)) from error
        if session and plan.rig in session.fit:
            session.fit.discard(plan.rig)
            refuse_quarantined(plan)
        else:
            await examine(plan, say, (*slot.descriptors, *more))
        await stack.enter_async_context(heartbeat(slot.cid, slot.key))
        yield (*slot.descriptors, *more)
