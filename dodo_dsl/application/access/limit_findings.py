"""Limits that an application sets for itself: none goes beyond those of ``sandbox`` in ``dodo.yml``.

Where one does, or where a file system in memory has none, a test's copy has the limit of the test. What a variable sets
only at run time is refused then.
"""

import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from dodo_dsl.application.access.model import AccessFinding, Look, Steps, at, items
from dodo_dsl.spec.sandbox_limits import SandboxLimits

Findings = Iterator[AccessFinding]
CPU_SHARES = 1024
"""The engine's default; DoDo's own services have twice as many."""
_MESSAGE_QUEUES = 819_200
"""The kernel's default, in bytes (RLIMIT_MSGQUEUE)."""
_DEPLOY = ("deploy", "resources", "limits")
_SIZE = re.compile(r"\s*(\d{1,20}(?:\.\d{0,20})?)\s*([kmgtp]?)(?:i?b)?\s*", re.IGNORECASE | re.ASCII)
_SIZES_OF_TMPFS = ("size=", "nr_blocks=")
_MOST_LOGS = 10
UNLIMITED = ("", "0", "-1")
"""Sizes of a log that a test's copy replaces by its own."""
_PERIOD = 100_000
"""us: the engine's default of ``cpu_period``."""


def of_service(service: Mapping[str, Any], look: Look) -> Findings:
    """Limits of a service beyond the test's, in plain values with their variables filled in.

    In a test's copy also those where nothing is written, and the engine would set no limit either.
    """
    whose = f"'{look.name}'"
    yield from (f for f in service_limits(service, look.limits, whose) if look.compiled or f.kind == "limit")


def of_volume(volume: Mapping[str, Any], look: Look) -> Findings:
    """The same of one of the top-level ``volumes``."""
    found = volume_limits(look.name, volume, look.limits)
    yield from (f for f in found if look.compiled or f.kind == "limit")


def service_limits(service: Mapping[str, Any], limits: SandboxLimits, whose: str = "the service") -> Findings:
    """The same with those that are not written, which are ``unlimited``."""
    for steps, most, measure, key in _bounds(service, limits):
        value, is_at_least_1 = at(service, steps), steps[-1] not in ("memswap_limit", "shm_size", "cpu_shares")
        if value is not None and _is_above(value, most, measure, is_at_least_1):
            is_text = steps[:1] == _DEPLOY[:1] and key != "processes"
            yield _beyond(steps, str(most) if is_text else most, key, _text(most, key), whose)
    yield from _quota(service, limits, whose)
    for base in (("ulimits",), ("build", "ulimits")):
        yield from _ulimits(base, at(service, base), limits, whose)
    yield from _tmpfs(service, limits, whose)
    yield from _logs(service, limits, whose)


def volume_limits(name: str, volume: Any, limits: SandboxLimits) -> Findings:
    """The same of one of the top-level ``volumes``: of a file system in memory."""
    if at(volume, ("driver_opts", "type")) == "tmpfs":
        options = str(at(volume, ("driver_opts", "o")) or "")
        shown = f"{name}.driver_opts.o"
        yield from _options(("driver_opts", "o"), options, limits, "the application's volumes", shown=shown)


def size(value: object) -> float:
    """Bytes of a size as compose reads it, ``8g``; infinite where it is none, or not known to be finite."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return value if value >= 0 else math.inf
    found = _SIZE.fullmatch(str(value))
    return float(found[1]) * 1024.0 ** " kmgtp".index(found[2].lower() or " ") if found else math.inf


def _number(value: object) -> float:
    try:
        found = float(str(value))
    except ValueError:
        return math.inf
    return found if found >= 0 else math.inf


def _is_above(value: object, most: float, measure: Callable[[object], float], is_at_least_1: bool = False) -> bool:
    """Whether a value is above ``most``, or is 0 if that sets no limit; never for a variable."""
    return "$" not in str(value) and (measure(value) > most or (is_at_least_1 and not measure(value)))


def _bounds(
    service: Mapping[str, Any], limits: SandboxLimits
) -> Iterator[tuple[Steps, int | float, Callable[[object], float], str]]:
    steps: Steps
    for steps in (("pids_limit",), (*_DEPLOY, "pids")):
        yield steps, limits.processes, _number, "processes"
    for steps in (("mem_limit",), (*_DEPLOY, "memory"), ("shm_size",), ("build", "shm_size")):
        yield steps, limits.memory, size, "memory"
    yield ("memswap_limit",), 2 * limits.memory, size, "memory"
    yield ("cpu_shares",), CPU_SHARES, _number, ""
    if limits.cpus is not None:
        for steps in (("cpus",), (*_DEPLOY, "cpus")):
            yield steps, limits.cpus, _number, "cpus"


def _quota(service: Mapping[str, Any], limits: SandboxLimits, whose: str) -> Findings:
    quota, period = service.get("cpu_quota"), service.get("cpu_period") or _PERIOD
    if limits.cpus is None or quota is None or "$" in f"{quota}{period}":
        return
    most = limits.cpus * _number(period)
    if math.isfinite(most) and _is_above(quota, most, _number, True):
        yield _beyond(("cpu_quota",), int(most), "cpus", f"{limits.cpus:g} processors", whose)


def _logs(service: Mapping[str, Any], limits: SandboxLimits, whose: str) -> Findings:
    """All files of a log together are no larger than one that a program may write."""
    steps = ("logging", "options")
    options = at(service, steps)
    if not isinstance(options, dict) or "$" in str(options.get("max-file")):
        return
    files = _number(options.get("max-file") or 1)
    if files > _MOST_LOGS:
        yield _beyond((*steps, "max-file"), str(_MOST_LOGS), "", str(_MOST_LOGS), whose)
    most = int(limits.file_size // max(1, min(files, _MOST_LOGS)))
    written = options.get("max-size")
    if written is not None and str(written).strip() not in UNLIMITED and _is_above(written, most, size):
        yield _beyond((*steps, "max-size"), str(most), "file-size", _text(most, "file-size"), whose)


def _ulimits(base: Steps, written: Any, limits: SandboxLimits, whose: str) -> Findings:
    """The highest limits of a process, with the keys of ``sandbox``; others bind a process to less than it has."""
    for name, most, key in (
        ("core", 0, ""),
        ("fsize", limits.file_size, "file-size"),
        ("nofile", limits.files, "files"),
        ("nproc", limits.processes, "processes"),
        ("memlock", limits.memory, "memory"),
        ("msgqueue", _MESSAGE_QUEUES, ""),
    ):
        value = at(written, (name,))
        parts = value.items() if isinstance(value, dict) else [("", value)] if value is not None else []
        for part, number in parts:
            if _is_above(number, most, _number):
                yield _beyond((*base, name, part) if part else (*base, name), most, key, _text(most, key), whose)


def _tmpfs(service: Mapping[str, Any], limits: SandboxLimits, whose: str) -> Findings:
    for steps, word in items(service, "tmpfs"):
        target, _, options = str(word).partition(":")
        own = steps if isinstance(service["tmpfs"], list) else steps[:1]
        if word or own is steps:
            yield from _options(own, options, limits, whose, before=f"{target}:")
    for steps, mount in items(service, "volumes"):
        value = at(mount, ("tmpfs", "size"))
        if at(mount, ("type",)) == "tmpfs" and (value is None or _is_above(value, limits.memory, size, True)):
            most, is_written = _text(limits.memory, "memory"), value is not None
            yield _beyond((*steps, "tmpfs", "size"), limits.memory, "memory", most, whose, is_written=is_written)


def _options(
    steps: Steps, options: str, limits: SandboxLimits, whose: str, *, before: str = "", shown: str = ""
) -> Findings:
    """Options of a file system in memory, as mount(8) reads them, with a size that it may have."""
    words = [word for word in options.split(",") if word]
    sizes = [word for word in words if word.startswith(_SIZES_OF_TMPFS)]
    is_above = any(_is_above(word.removeprefix("size="), limits.memory, size, True) for word in sizes)
    if "$" in options or (sizes and not is_above):
        return
    allowed = ",".join([*(word for word in words if word not in sizes), f"size={limits.memory}"])
    most = _text(limits.memory, "memory")
    yield _beyond(steps, f"{before}{allowed}", "memory", most, whose, is_written=bool(sizes), shown=shown)


def _beyond(
    steps: Steps, allowed: float | str, key: str, most: str, whose: str, *, is_written: bool = True, shown: str = ""
) -> AccessFinding:
    """A value beyond a limit, with ``most`` for people; ``key`` of ``sandbox`` sets the limit, if one does."""
    name = shown or dotted(steps)
    hint = f"it is cut; '{key}' of 'sandbox' in dodo.yml sets the limit" if key else "it is cut"
    message = f"'{name}' of {whose} is beyond the test's limit of {most}"
    return AccessFinding(steps, message, hint, "limit" if is_written else "unlimited", allowed=allowed)


def dotted(steps: Steps) -> str:
    """The key as people write it: ``ulimits.nofile.hard``."""
    return ".".join(step for step in steps if isinstance(step, str))


def put(written: Any, finding: AccessFinding) -> None:
    """Changes a plain value in place, so that it has what is allowed."""
    *way, last = finding.steps
    for step in way:
        if isinstance(written, dict) and not isinstance(written.get(step), dict | list):
            written[step] = {}
        written = written[step]
    written[last] = finding.allowed


def _text(most: float, key: str) -> str:
    if key in ("memory", "file-size"):
        return f"{most / 10**9:g} GB ({most:,.0f} bytes)"
    return f"{most:,g}" if most < 10**6 else f"{most:,.0f}"
