"""The ports of rigs: no program of a test may open one but the service that moves the rig."""

import contextlib
import os
import re
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path

from dodo_dsl.plan.model import Plan, PlannedService
from dodo_dsl.run.rigs.leases import identity
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.spec.rig import EMULATED, is_simulated

_SYS = Path("/sys/dev/char")
_USB = Path("/dev/bus/usb")
_ABOVE = 6
_NUMBER = re.compile(r"[0-9]{1,3}")


def known_ports(plan: Plan) -> list[str]:
    """The ports of the test's rig, and of its deployment's others."""
    found = [service.port for service in plan.services if service.port]
    return list(dict.fromkeys([*found, *plan.application.access.ports]))


def refuse_shared_port(plan: Plan) -> None:
    """Raises RigProblem where a service would open the port of a rig that another one moves."""
    owners = {identity(service.port): service.name for service in plan.services if service.port}
    for service in plan.services:
        for flag in service.flags:
            owner = owners.get(identity(flag.value)) if flag.kind == "text" and flag.value != service.port else None
            if owner and not service.port:
                text = f"'{service.name}' would open '{flag.value}', the port of the rig, which only '{owner}' may open"
                raise RigProblem(text, usage=True)


def refuse_unattended(plan: Plan) -> None:
    """Raises RigProblem for a test that needs a rig and has none, or moves hardware that nothing leases or checks."""
    if plan.is_real:
        return
    if plan.lacks_rig and not any(service.port for service in plan.services):
        text = f"the test needs a {plan.rig} rig, and dodo.yml has none: run it with --emulate, or let dodo.yml have an"
        raise RigProblem(f"{text} emulated one: {{kind: {plan.rig}, emulated: true}} under 'rigs'")
    for service in plan.services:
        port = next((flag.value for flag in service.flags if flag.name == "serial"), EMULATED)
        if service.uses == "gantry" and not is_simulated(port):
            raise RigProblem(f"service '{service.name}' would move what is at '{port}', and the test runs on no rig")


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
    number = Path(path).stat().st_rdev
    entry = Path(os.path.realpath(_SYS / f"{os.major(number)}:{os.minor(number)}"))
    for folder in (entry, *entry.parents[:_ABOVE]):
        try:
            bus, device = ((folder / name).read_text().strip() for name in ("busnum", "devnum"))
        except OSError:
            continue
        file = _USB / f"{bus:0>3}" / f"{device:0>3}"
        if _NUMBER.fullmatch(bus) and _NUMBER.fullmatch(device) and file.exists():
            yield str(file)
        return
