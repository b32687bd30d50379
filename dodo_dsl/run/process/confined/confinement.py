"""What a service of the application sees and may use, as the runner tells its sandbox."""

import sys
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits

_PACKAGE = Path(__file__).resolve().parents[3]
INTERPRETER = tuple(dict.fromkeys((sys.prefix, sys.base_prefix)))
"""The folders of this Python, which starts the application's programs."""


@dataclass(frozen=True)
class Confinement:
    """``folder`` is the application's own, ``reads`` is what else it may read, ``hidden`` lies in them and stays out.

    With ``isolation`` ``host`` it has only processes of its own, and sees what DoDo sees but for ``masked`` devices.
    ``cid`` says which user id of its own is tried first, where DoDo runs as root.
    """

    folder: str
    isolation: str
    cid: int
    reads: tuple[str, ...] = ()
    hidden: tuple[str, ...] = ()
    limits: SandboxLimits = field(default_factory=SandboxLimits)
    masked: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_json(cls, raw: Mapping[str, Any]) -> "Confinement":
        lists = {name: tuple(raw[name]) for name in ("reads", "hidden", "masked")}
        limits = SandboxLimits(**{**raw["limits"], "reads": tuple(raw["limits"]["reads"])})
        return cls(**{**raw, **lists, "limits": limits})


def confinement(folder: Path, isolation: str, cid: int, limits: SandboxLimits, hidden: Iterable[Path]) -> Confinement:
    """The confinement of an application; of the ``hidden`` folders those matter that lie below its own."""
    reads = [str((folder / Path(path).expanduser()).resolve()) for path in limits.reads]
    inside = [str(path) for path in hidden if path != folder and path.is_relative_to(folder)]
    every = dict.fromkeys([*INTERPRETER, str(_PACKAGE), *reads])
    return Confinement(str(folder), isolation, cid, tuple(every), (*inside,), limits)
