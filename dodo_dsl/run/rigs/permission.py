"""What the operator of a machine permits with its rigs, before anything opens their devices."""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.rigs.devices import identity
from dodo_dsl.run.rigs.ports import refuse_shared_port
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.run.rigs.rig_leases import devices_in
from dodo_dsl.spec.deployment import machine as operator
from dodo_dsl.spec.deployment.machine import UNITS, PermittedRig
from dodo_dsl.spec.deployment.rig import EMULATED, is_simulated

LIMIT_FLAGS = {
    "x": "range-x",
    "y": "range-y",
    "yaw": "range-yaw",
    "speed": "max-speed",
    "yaw-rate": "max-yaw-rate",
}
"""The gantry's flags for the operator's limits; they have the same units."""
_GANTRY = "gantry"


def refuse_forbidden(devices: Iterable[str], limits: Mapping[str, float], roots: Sequence[Path]) -> None:
    """Raises RigProblem where the operator does not permit these devices, or these limits, to all of the folders.

    Without a file of the operator everything is permitted. ``limits`` are those that the motion will have, in UNITS.
    """
    try:
        known = operator.machine()
    except operator.MachineError as error:
        raise RigProblem(f"{error.filename}: {error.strerror}") from None
    if known is None:
        return
    for device in devices:
        if identity(device):
            _refuse_strangers(_rig_of(device, known.rigs), limits, roots)


def refuse_test(plan: Plan, roots: Sequence[Path]) -> None:
    """The same for a test on a real rig, by the flags of all its services; also where two would open one port."""
    refuse_shared_port(plan)
    words = {flag.name: flag.value for service in plan.services if service.uses == _GANTRY for flag in service.flags}
    limits = {name: float(words[flag]) for name, flag in LIMIT_FLAGS.items() if flag in words}
    devices = devices_in(f"--{flag.name}={flag.value}" for service in plan.services for flag in service.flags)
    moves = any(service.uses == _GANTRY for service in plan.services)
    refuse_forbidden(devices, limits if moves else dict.fromkeys(LIMIT_FLAGS, 0.0), roots)


def refuse_unattended(plan: Plan) -> None:
    """Raises RigProblem for a test that would move hardware without a rig, which nothing leases or checks."""
    if plan.rig and plan.rig != EMULATED:
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


def _refuse_strangers(rig: PermittedRig, limits: Mapping[str, float], roots: Sequence[Path]) -> None:
    permitted = [folder.resolve() for folder in rig.repositories]
    for root in roots:
        if not any(root.resolve().is_relative_to(folder) for folder in permitted):
            text = f"'{root}' may not use rig '{rig.name}' of {operator.FILE}, which has other repositories"
            raise RigProblem(text, usage=True)
    for name, most in rig.limits.items():
        limit = limits.get(name, math.inf)
        if limit > most:
            found = f"{limit:g} {UNITS[name]}" if math.isfinite(limit) else "not set"
            text = f"limits.{name} is {found}, and {operator.FILE} permits {most:g} {UNITS[name]} at most"
            raise RigProblem(f"{text}; set it for the rig in dodo.yml", usage=True)
