"""What the operator of a machine permits with its rigs, before anything opens their devices: ports and motion.

The limits of a rig's motion are by its repository, as the operator measures them. No program of a test may open a
rig's port but the service that moves the rig.
"""

import contextlib
import math
import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dodo_dsl.plan.model import Plan, PlannedService
from dodo_dsl.run.rigs.leases import devices_of, identity
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.spec import machine as operator
from dodo_dsl.spec.machine import UNITS, PermittedRig
from dodo_dsl.spec.rig import CIRCLE, EMULATED, MEMORY_FLAG, is_simulated

LIMIT_FLAGS = {
    "x": "range-x",
    "y": "range-y",
    "yaw": "range-yaw",
    "speed": "max-speed",
    "yaw-rate": "max-yaw-rate",
    "acceleration": "max-acceleration",
    "yaw-acceleration": "max-yaw-acceleration",
}
"""The gantry's flags for the operator's limits; they have the same units."""
RANGES = ("x", "y", "yaw")
BUILT_IN = {"steps-x": 3320.0, "steps-y": 3320.0, "steps-yaw": 0.55, "offset-yaw": 83.0}
"""The firmware's constants, by the gantry's flags: full steps per m, m, degree, and from home to heading 0."""
BUILT_IN_CIRCLE = {**BUILT_IN, "steps-yaw": 200 / 360, "offset-yaw": 100.0}


@dataclass(frozen=True)
class Motion:
    """``limits`` in the operator's units, of which one that is missing is unlimited; ``constants`` that differ."""

    limits: Mapping[str, float]
    constants: Mapping[str, float] = field(default_factory=dict)
    circle: bool = False

    def by(self, constants: Mapping[str, float]) -> dict[str, float]:
        """The limits as they are by the repository's own constants or by others, whichever are larger.

        A repository that says of a rig that its steps are longer would else get it to go farther.
        """
        built = BUILT_IN_CIRCLE if self.circle else BUILT_IN
        own, theirs = {**built, **self.constants}, {**built, **constants}
        x, y, yaw = (own[name] / theirs[name] for name in ("steps-x", "steps-y", "steps-yaw"))
        shares = {"x": x, "y": y, "yaw": yaw, "speed": max(x, y), "acceleration": max(x, y)}
        shift = 0.0 if self.circle else abs(own["offset-yaw"] - theirs["offset-yaw"]) / theirs["steps-yaw"]
        found = {}
        for name, limit in self.limits.items():
            share = shares.get(name, yaw)
            found[name] = max(limit, limit * share + (shift if name == "yaw" and limit else 0.0))
        return found


STILL = Motion(dict.fromkeys(LIMIT_FLAGS, 0.0))
"""Nothing moves."""


def motion_of(words: Mapping[str, str], manual: bool = False) -> Motion:
    """The motion by the gantry's flags: what it does itself, and what it has the rig's memory keep for others.

    Of a ``manual`` motion speeds and accelerations are those that the memory keeps.
    """
    circle = words.get("kind") == CIRCLE
    kept = _kept(words.get(MEMORY_FLAG, ""))
    limits = {}
    for name, flag in LIMIT_FLAGS.items():
        own = 0.0 if manual and name not in RANGES else math.inf
        limits[name] = max(_number(words[flag]) if flag in words else own, kept.get(name, math.inf))
    constants = {name: _number(words[name]) for name in BUILT_IN if name in words}
    return Motion(limits | ({"yaw": math.inf} if circle else {}), constants, circle)


def _kept(text: str) -> dict[str, float]:
    """The limits for the memory in the operator's units; one that cannot be read counts as unlimited."""
    found = {}
    for word in text.split(","):
        name, _, number = word.partition("=")
        found[name] = math.degrees(_number(number)) if name == "yaw" else _number(number)
    return found


def _number(text: str) -> float:
    """A number of a compiled file, which anyone may have changed; what is none, such as "nan", bounds nothing."""
    try:
        value = float(text)
    except ValueError:
        return math.inf
    return value if math.isfinite(value) else math.inf


_SYS = Path("/sys/dev/char")
_USB = Path("/dev/bus/usb")
_ABOVE = 6
_NUMBER = re.compile(r"[0-9]{1,3}")


def known_ports(plan: Plan) -> list[str]:
    """The ports of the test's rig, of its deployment's others, and of those that the machine's operator names.

    Raises MachineError: without the operator's file, which names the ports, it is unknown which ones to protect.
    """
    found = [service.port for service in plan.services if service.port]
    return list(dict.fromkeys([*found, *plan.application.access.ports, *_of_operator()]))


def _of_operator() -> Iterator[str]:
    """Terminals among the operator's devices: the others are cameras."""
    known = operator.machine()
    for rig in known.rigs if known else ():
        yield from (device for device in rig.devices if _is_terminal(device))


def _is_terminal(device: str) -> bool:
    entry = _entry(device)
    return entry is not None and "tty" in entry.parts


def refuse_shared_port(plan: Plan) -> None:
    """Raises RigProblem where a service would open the port of a rig that another one moves."""
    owners = {identity(service.port): service.name for service in plan.services if service.port}
    for service in plan.services:
        for flag in service.flags:
            owner = owners.get(identity(flag.value)) if flag.kind == "text" and flag.value != service.port else None
            if owner and not service.port:
                text = f"'{service.name}' would open '{flag.value}', the port of the rig, which only '{owner}' may open"
                raise RigProblem(text, usage=True)


def masked(plan: Plan, service: PlannedService | None) -> list[str]:
    """The device files that a service must not see, None for the application: of all ports but its own."""
    own = set(device_files([service.port])) if service and service.port else set()
    return [file for file in device_files(known_ports(plan)) if file not in own]


def device_files(ports: Iterable[str]) -> list[str]:
    """The device files of ports that are there: their own, and those by which USB reaches them past the port."""
    found = []
    for port in ports:
        path = os.path.realpath(port) if port.startswith("/") else ""
        with contextlib.suppress(OSError):
            if path and stat.S_ISCHR(Path(path).stat().st_mode):
                found += [path, *_usb_device(path)]
    return list(dict.fromkeys(found))


def _usb_device(path: str) -> Iterator[str]:
    entry = _entry(path)
    for folder in (entry, *entry.parents[:_ABOVE]) if entry else ():
        try:
            bus, device = ((folder / name).read_text().strip() for name in ("busnum", "devnum"))
        except OSError:
            continue
        file = _USB / f"{bus:0>3}" / f"{device:0>3}"
        if _NUMBER.fullmatch(bus) and _NUMBER.fullmatch(device) and file.exists():
            yield str(file)
        return


def _entry(device: str) -> Path | None:
    """The folder of a device in the kernel's tree, if it is there."""
    try:
        number = Path(device).stat().st_rdev
    except (OSError, ValueError):
        return None
    entry = _SYS / f"{os.major(number)}:{os.minor(number)}"
    return Path(os.path.realpath(entry)) if entry.exists() else None


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
    moves = any(service.uses == _GANTRY for service in plan.services)
    refuse_forbidden(devices_of(plan), motion_of(words) if moves else STILL, roots)


def refuse_unattended(plan: Plan) -> None:
    """Raises RigProblem for a test that needs a rig and has none, or moves hardware that nothing leases or checks."""
    if plan.is_real:
        return
    if plan.lacks_rig and not any(service.port for service in plan.services):
        text = f"the test needs a {plan.rig} rig, and dodo.yml has none: run it with --emulate, or let dodo.yml have an"
        raise RigProblem(f"{text} emulated one: {{kind: {plan.rig}, emulated: true}} under 'rigs'")
    for service in plan.services:
        port = next((flag.value for flag in service.flags if flag.name == "serial"), EMULATED)
        if service.uses == _GANTRY and not is_simulated(port):
            raise RigProblem(f"service '{service.name}' would move what is at '{port}', and the test runs on no rig")


def _rig_of(device: str, rigs: Iterable[PermittedRig]) -> PermittedRig:
    for rig in rigs:
        if identity(device) in map(identity, rig.devices):
            return rig
    raise RigProblem(
        f"'{device}' is not a device of a rig in {operator.FILE}, which lists all that may be used", usage=True
    )


def _refuse_strangers(rig: PermittedRig, motion: Motion, roots: Sequence[Path]) -> None:
    permitted = [folder.resolve() for folder in rig.repositories]
    for root in roots:
        if not any(root.resolve().is_relative_to(folder) for folder in permitted):
            text = f"'{root}' may not use rig '{rig.name}': it is not in this rig's 'repositories' in {operator.FILE}"
            raise RigProblem(text, usage=True)
    limits, own = motion.by(rig.constants), motion.limits
    for name, most in rig.limits.items():
        limit = limits.get(name, math.inf)
        if limit > most * (1 + _EXACT):
            found = f"{limit:g} {UNITS[name]}" if math.isfinite(limit) else "not set"
            found += " by the operator's constants of its axes" if math.isfinite(limit) and limit > own[name] else ""
            text = f"limits.{name} is {found}, and {operator.FILE} permits {most:g} {UNITS[name]} at most"
            raise RigProblem(f"{text}; set it for the rig in dodo.yml", usage=True)
