"""The operator's word on the rigs of a machine: ``/etc/dodo/rigs.yml``, which no test and no job can change.

It shows where leases and quarantines are kept, which devices are rigs, how far they may move at most, and the
repositories whose tests may move them. A repository's ``dodo.yml`` can only be stricter.
"""

import functools
import os
import stat
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Mapping, parse, plain
from dodo_dsl.spec import quantity
from dodo_dsl.spec.rig import LIMIT_UNITS
from dodo_dsl.spec.validation import validate

FILE = Path("/etc/dodo/rigs.yml")
UNITS = {**LIMIT_UNITS, "yaw": "deg"}
"""Of the limits; an operator reads degrees."""
DENSITIES = {"x": "steps/m", "y": "steps/m", "yaw": "steps/deg"}
"""The units of an axis' steps."""


class MachineError(OSError):
    """The operator's file cannot be used; one sentence."""

    def __str__(self) -> str:
        return f"{self.filename}: {self.strerror}"


@dataclass(frozen=True)
class PermittedRig:
    """Devices that a rig has, its largest limits in ``UNITS``, and folders of repositories that may move it.

    ``constants`` are those of its axes that the operator measured, by the gantry's flags such as ``steps-x``.
    """

    name: str
    devices: tuple[str, ...]
    repositories: tuple[Path, ...] = ()
    limits: dict[str, float] = field(default_factory=dict)
    constants: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Machine:
    """The operator's file; a path is None if it names none."""

    rigs: tuple[PermittedRig, ...] = ()
    leases: Path | None = None
    quarantine: Path | None = None


def machine(file: Path | None = None) -> Machine | None:
    """What the operator of this machine wrote; None without a file. Raises MachineError."""
    path = file or FILE
    try:
        status = path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise MachineError(error.errno, error.strerror, str(path)) from None
    if not stat.S_ISREG(status.st_mode) or status.st_uid not in (0, os.geteuid()) or status.st_mode & 0o022:
        raise MachineError(None, "expected a file of root that only root can write", str(path))
    return _read(path, status.st_mtime_ns)


@functools.lru_cache(maxsize=4)
def _read(path: Path, _changed: int) -> Machine:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise MachineError(None, f"cannot be read: {error}", str(path)) from None
    node, found = parse(text, str(path))
    problems = [*found, *(validate(node, "machine") if node is not None else ())]
    if problems or not isinstance(node, Mapping):
        raise MachineError(None, *_first(problems, path))
    raw = plain(node)
    places = {key: Path(raw[key]) if key in raw else None for key in ("leases", "quarantine")}
    return Machine(tuple(_rig(path, name, rig) for name, rig in (raw.get("rigs") or {}).items()), **places)


def _first(problems: Sequence[Diagnostic], path: Path) -> tuple[str, str]:
    """The first problem of a file in its order, with its hint, and its position."""
    if not problems:
        return "is empty, expected 'dodo: 1'", str(path)
    first = min(problems, key=lambda d: (d.span.line, d.span.column))
    hint = f"; {first.hint}" if first.hint else ""
    return f"{first.message}{hint}", f"{path}:{first.span.line}:{first.span.column}"


def _rig(path: Path, name: str, raw: dict[str, object]) -> PermittedRig:
    written = raw.get("limits") or {}
    assert isinstance(written, dict)
    try:
        limits = {key: float(quantity.convert(value, UNITS[key])) for key, value in written.items()}
        constants = {flag: float(quantity.convert(*value)) for flag, value in _constants(raw).items()}
    except quantity.QuantityError as error:
        raise MachineError(None, f"rig '{name}': {error}", str(path)) from None
    devices, repositories = raw["devices"], raw.get("repositories") or []
    assert isinstance(devices, list) and isinstance(repositories, list)
    return PermittedRig(name, tuple(devices), tuple(map(Path, repositories)), limits, constants)


def _constants(raw: dict[str, object]) -> dict[str, tuple[str, str]]:
    """Quantities of the axes as written, and their units, by the gantry's flags."""
    axes = raw.get("axes") or {}
    assert isinstance(axes, dict)
    return {
        f"{what}-{axis}": (text, DENSITIES[axis] if what == "steps" else "steps")
        for axis, about in axes.items()
        for what, text in (about or {}).items()
    }
