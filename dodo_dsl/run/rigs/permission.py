"""What the operator of a machine permits with its rigs, before anything opens their devices."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.rigs.devices import identity
from dodo_dsl.run.rigs.motion import STILL, Motion, motion_of
from dodo_dsl.run.rigs.ports import refuse_shared_port
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.run.rigs.rig_leases import devices_in
from dodo_dsl.spec.deployment import machine as operator
from dodo_dsl.spec.deployment.machine import UNITS, PermittedRig
from dodo_dsl.spec.deployment.rig import EMULATED, EMULATED_RIGS, is_simulated

_GANTRY = "gantry"
_EXACT = 1e-9
"""A share that a conversion of units may be off."""


def refuse_forbidden(devices: Iterable[str], motion: Motion, roots: Sequence[Path]) -> None:
    """Raises RigProblem where the operator does not permit these devices, or this motion, to all of the folders.

    Without a file of the operator everything is permitted.
    """
    try:
        known = operator.machine()
    except operator.MachineError as error:
        raise RigProblem(str(error)) from None
    if known is None:
        return
    for device in devices:
        if identity(device):
            _refuse_strangers(_rig_of(device, known.rigs), motion, roots)


def refuse_test(plan: Plan, roots: Sequence[Path]) -> None:
    """The same for a test on a real rig, by the flags of all its services; also where two would open one port."""
    refuse_shared_port(plan)
    words = {flag.name: flag.value for service in plan.services if service.uses == _GANTRY for flag in service.flags}
    devices = devices_in(f"--{flag.name}={flag.value}" for service in plan.services for flag in service.flags)
    moves = any(service.uses == _GANTRY for service in plan.services)
    refuse_forbidden(devices, motion_of(words) if moves else STILL, roots)


def refuse_unattended(plan: Plan) -> None:
    """Raises RigProblem for a test that would move hardware without a rig, which nothing leases or checks."""
    if plan.rig and plan.rig not in EMULATED_RIGS:
        return
    for service in plan.services:
        port = next((flag.value for flag in service.flags if flag.name == "serial"), EMULATED)
        if service.uses == _GANTRY and not is_simulated(port):
            raise RigProblem(f"service '{service.name}' would move what is at '{port}', and the test runs on no rig")


def _rig_of(device: str, rigs: Iterable[PermittedRig]) -> PermittedRig:
    for rig in rigs:
        if identity(device) in map(identity, rig.devices):
            return rig
    raise RigProblem(f"'{device}' is not a rig's device in {operator.FILE}, which has all that may be used", usage=True)


def _refuse_strangers(rig: PermittedRig, motion: Motion, roots: Sequence[Path]) -> None:
    permitted = [folder.resolve() for folder in rig.repositories]
    for root in roots:
        if not any(root.resolve().is_relative_to(folder) for folder in permitted):
            text = f"'{root}' may not use rig '{rig.name}' of {operator.FILE}, which has other repositories"
            raise RigProblem(text, usage=True)
    limits, own = motion.by(rig.constants), motion.limits
    for name, most in rig.limits.items():
        limit = limits.get(name, math.inf)
        if limit > most * (1 + _EXACT):
            found = f"{limit:g} {UNITS[name]}" if math.isfinite(limit) else "not set"
            found += " by the operator's constants of its axes" if math.isfinite(limit) and limit > own[name] else ""
            text = f"limits.{name} is {found}, and {operator.FILE} permits {most:g} {UNITS[name]} at most"
            raise RigProblem(f"{text}; set it for the rig in dodo.yml", usage=True)
