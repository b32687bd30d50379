"""Limits that an application sets for itself: none goes beyond those of ``sandbox`` in ``dodo.yml``.

Where one does, or where a file system in memory has none, a test's copy has the limit of the test. What a variable sets
only at run time is refused then.
"""

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from dodo_dsl.application.access.model import AccessFinding, Steps
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits

Findings = Iterator[AccessFinding]
CPU_SHARES = 1024
"""The engine's default; DoDo's own services have twice as many."""
_MESSAGE_QUEUES = 819_200
"""The kernel's default, in bytes (RLIMIT_MSGQUEUE)."""
_DEPLOY = ("deploy", "resources", "limits")
_SIZE = re.compile(r"\s*(\d{1,20}(?:\.\d{0,20})?)\s*([kmgtp]?)(?:i?b)?\s*", re.IGNORECASE | re.ASCII)
_POWERS = {letter: 1024**power for power, letter in enumerate(("", "k", "m", "g", "t", "p"))}
_SIZES_OF_TMPFS = ("size=", "nr_blocks=")
_MOST_LOGS = 10
_UNLIMITED = ("", "0", "-1")
"""Sizes of a log that a test's copy replaces by its own."""
_PERIOD = 100_000
"""us: the engine's default of ``cpu_period``."""


@dataclass(frozen=True)
class Excess:
    """A value beyond a limit, and ``allowed`` in its place; ``key`` of ``sandbox`` sets the limit, if one does.

    ``is_written`` is False where the file sets nothing, and the engine would set no limit either. ``most`` is the
    limit for people.
    """

    steps: Steps
    allowed: int | float | str
    key: str
    most: str
    is_written: bool = True

    @property
    def shown(self) -> str:
        """The key as people write it: ``ulimits.nofile.hard``."""
        return ".".join(step for step in self.steps if isinstance(step, str))


def limit_findings(name: str, service: Mapping[str, Any], limits: SandboxLimits, compiled: bool) -> Findings:
    """Limits of the service ``name`` beyond the test's; in a ``compiled`` test also where nothing is written."""
    yield from _findings(f"'{name}'", service_excesses(service, limits), compiled)


def volume_findings(volumes: Mapping[str, Any], limits: SandboxLimits, compiled: bool) -> Findings:
    """The same of the top-level ``volumes``."""
    found = _findings("the application's volumes", volume_excesses(volumes, limits), compiled)
    yield from (finding.below("volumes") for finding in found)


def _findings(whose: str, found: Iterator[Excess], compiled: bool) -> Findings:
    for excess in found:
        if excess.is_written or compiled:
            message = f"'{excess.shown}' of {whose} is beyond the test's limit of {excess.most}"
            hint = f"it is cut; '{excess.key}' of 'sandbox' in dodo.yml sets the limit" if excess.key else "it is cut"
            yield AccessFinding(excess.steps, message, hint, "limit")


def service_excesses(service: Mapping[str, Any], limits: SandboxLimits) -> Iterator[Excess]:
    """What a service sets beyond its limits, in plain values with their variables filled in."""
    for steps, above, allowed, key in _rows(limits):
        value = _at(service, steps)
        if value is not None and above(value):
            yield Excess(steps, allowed, key, _text(float(allowed), key))
    yield from _quota(service, limits)
    for base in (("ulimits",), ("build", "ulimits")):
        yield from _ulimits(base, _at(service, base), limits)
    yield from _tmpfs(service, limits)
    yield from _logs(service, limits)


def volume_excesses(volumes: Mapping[str, Any], limits: SandboxLimits) -> Iterator[Excess]:
    """The same of the top-level ``volumes``: file systems in memory."""
    for name, about in volumes.items() if isinstance(volumes, dict) else ():
        options = about.get("driver_opts") if isinstance(about, dict) else None
        if isinstance(options, dict) and options.get("type") == "tmpfs":
            steps = (name, "driver_opts", "o")
            yield from _options(steps, str(options.get("o") or ""), limits)


def size(value: object) -> float:
    """Bytes of a size as compose reads it, ``8g``; infinite where it is none, or not known to be finite."""
    if isinstance(value, bool):
        return math.inf
    if isinstance(value, int | float):
        return value if value >= 0 else math.inf
    found = _SIZE.fullmatch(str(value))
    return float(found[1]) * _POWERS[found[2].lower()] if found else math.inf


def _number(value: object) -> float:
    try:
        found = float(str(value))
    except ValueError:
        return math.inf
    return found if found >= 0 else math.inf


def _above(most: float, measure: Callable[[object], float], zero_is_none: bool = False) -> Callable[[object], bool]:
    """Whether a value is above ``most``; with ``zero_is_none`` also where it is 0, which sets no limit."""

    def above(value: object) -> bool:
        return "$" not in str(value) and (measure(value) > most or (zero_is_none and not measure(value)))

    return above


def _rows(limits: SandboxLimits) -> Iterator[tuple[Steps, Callable[[object], bool], int | float | str, str]]:
    memory, processes = limits.memory, limits.processes
    most_memory, most_processes = _above(memory, size, True), _above(processes, _number, True)
    yield ("pids_limit",), most_processes, processes, "processes"
    yield (*_DEPLOY, "pids"), most_processes, processes, "processes"
    yield ("mem_limit",), most_memory, memory, "memory"
    yield (*_DEPLOY, "memory"), most_memory, str(memory), "memory"
    yield ("memswap_limit",), _above(2 * memory, size), 2 * memory, "memory"
    for steps in (("shm_size",), ("build", "shm_size")):
        yield steps, _above(memory, size), memory, "memory"
    yield ("cpu_shares",), _above(CPU_SHARES, _number), CPU_SHARES, ""
    if limits.cpus is not None:
        yield ("cpus",), _above(limits.cpus, _number, True), limits.cpus, "cpus"
        yield (*_DEPLOY, "cpus"), _above(limits.cpus, _number, True), str(limits.cpus), "cpus"


def _quota(service: Mapping[str, Any], limits: SandboxLimits) -> Iterator[Excess]:
    quota, period = service.get("cpu_quota"), service.get("cpu_period") or _PERIOD
    if limits.cpus is None or quota is None or "$" in f"{quota}{period}":
        return
    most = limits.cpus * _number(period)
    if math.isfinite(most) and _above(most, _number, True)(quota):
        yield Excess(("cpu_quota",), int(most), "cpus", f"{limits.cpus:g} processors")


def _logs(service: Mapping[str, Any], limits: SandboxLimits) -> Iterator[Excess]:
    """All files of a log together are no larger than one that a program may write."""
    steps = ("logging", "options")
    options = _at(service, steps)
    if not isinstance(options, dict) or "$" in str(options.get("max-file")):
        return
    files = _number(options.get("max-file") or 1)
    if files > _MOST_LOGS:
        yield Excess((*steps, "max-file"), str(_MOST_LOGS), "", str(_MOST_LOGS))
    most = int(limits.file_size // max(1, min(files, _MOST_LOGS)))
    written = options.get("max-size")
    if written is not None and str(written).strip() not in _UNLIMITED and _above(most, size)(written):
        yield Excess((*steps, "max-size"), str(most), "file-size", _text(most, "file-size"))


def _ulimits(base: Steps, written: Any, limits: SandboxLimits) -> Iterator[Excess]:
    for name, (most, key) in _ulimit_bounds(limits).items():
        value = written.get(name) if isinstance(written, dict) else None
        parts = value.items() if isinstance(value, dict) else [("", value)] if value is not None else []
        for part, number in parts:
            if _above(most, _number)(number):
                yield Excess((*base, name, part) if part else (*base, name), most, key, _text(most, key))


def _ulimit_bounds(limits: SandboxLimits) -> dict[str, tuple[int, str]]:
    """The highest limits of a process, with the keys of ``sandbox``; others bind a process to less than it has."""
    return {
        "core": (0, ""),
        "fsize": (limits.file_size, "file-size"),
        "nofile": (limits.files, "files"),
        "nproc": (limits.processes, "processes"),
        "memlock": (limits.memory, "memory"),
        "msgqueue": (_MESSAGE_QUEUES, ""),
    }


def _tmpfs(service: Mapping[str, Any], limits: SandboxLimits) -> Iterator[Excess]:
    written = service.get("tmpfs")
    for item, word in enumerate(written if isinstance(written, list) else [written] if written else []):
        target, _, options = str(word).partition(":")
        steps: Steps = ("tmpfs", item) if isinstance(written, list) else ("tmpfs",)
        for excess in _options(steps, options, limits):
            yield replace(excess, allowed=f"{target}:{excess.allowed}")
    mounts = service.get("volumes")
    for item, mount in enumerate(mounts if isinstance(mounts, list) else ()):
        if not isinstance(mount, dict) or mount.get("type") != "tmpfs":
            continue
        value = _at(mount, ("tmpfs", "size"))
        if value is None or _above(limits.memory, size, True)(value):
            most = _text(limits.memory, "memory")
            yield Excess(("volumes", item, "tmpfs", "size"), limits.memory, "memory", most, value is not None)


def _options(steps: Steps, options: str, limits: SandboxLimits) -> Iterator[Excess]:
    """Options of a file system in memory, as mount(8) reads them, with a size that it may have."""
    words = [word for word in options.split(",") if word]
    sizes = [word for word in words if word.startswith(_SIZES_OF_TMPFS)]
    above = _above(limits.memory, size, True)
    if "$" in options or (sizes and not any(above(word.removeprefix("size=")) for word in sizes)):
        return
    allowed = ",".join([*(word for word in words if word not in sizes), f"size={limits.memory}"])
    yield Excess(steps, allowed, "memory", _text(limits.memory, "memory"), bool(sizes))


def _text(most: float, key: str) -> str:
    if key in ("memory", "file-size"):
        return f"{most / 10**9:g} GB ({most:,.0f} bytes)"
    return f"{most:,g}" if most < 10**6 else f"{most:,.0f}"


def _at(value: Any, steps: Steps) -> Any:
    for step in steps:
        value = value.get(step) if isinstance(value, dict) else None
    return value
