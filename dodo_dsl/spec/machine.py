"""The operator's word on the rigs of a machine: ``/etc/dodo/rigs.yml``, which no test and no job can change.

It shows where leases and quarantines are kept, which devices are rigs, how far they may move at most, and the
repositories whose tests may move them. A repository's ``dodo.yml`` can only be stricter.
"""

import functools
import os
import stat
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dodo_dsl.source import Mapping, parse
from dodo_dsl.spec.rig import LIMIT_UNITS
from dodo_dsl.spec.validation import schema_of_keys, validate, values

FILE = Path("/etc/dodo/rigs.yml")
UNITS = {**LIMIT_UNITS, "yaw": "deg"}
"""Of the limits; an operator reads degrees."""


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
    if problems:
        first = min(problems, key=lambda problem: problem.span)
        message = f"{first.message}; {first.hint}" if first.hint else first.message
        raise MachineError(None, message, f"{path}:{first.span.line}:{first.span.column}")
    if not isinstance(node, Mapping):
        raise MachineError(None, "is empty, expected 'dodo: 1'", str(path))
    raw = values(node, schema_of_keys("machine"))
    places = {key: Path(raw[key]) if key in raw else None for key in ("leases", "quarantine")}
    return Machine(tuple(_rig(name, rig) for name, rig in raw.get("rigs", {}).items()), **places)


def _rig(name: str, raw: dict[str, Any]) -> PermittedRig:
    axes = raw.get("axes", {}).items()
    constants = {f"{what}-{axis}": number for axis, about in axes for what, number in about.items()}
    repositories = tuple(map(Path, raw.get("repositories", ())))
    return PermittedRig(name, tuple(raw["devices"]), repositories, raw.get("limits", {}), constants)
