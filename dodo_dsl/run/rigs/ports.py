"""Ports of rigs on this machine: which no program of a test may open but the service that moves the rig."""

import contextlib
import os
import re
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path

from dodo_dsl.plan.model import Plan, PlannedService
from dodo_dsl.run.rigs.devices import identity
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.spec.deployment import machine as operator

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
