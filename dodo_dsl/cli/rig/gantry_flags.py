"""A dynamic rig's settings as flags of the programs that move it, and as limits that its operator permits."""

from pathlib import Path

from dodo_dsl.cli.errors import UsageError
from dodo_dsl.run.rigs.motion import Motion, motion_of
from dodo_dsl.source import Scalar
from dodo_dsl.spec.deployment.rig import CIRCLE, MEMORY, Rig
from dodo_dsl.spec.manifest import Parameter
from dodo_dsl.spec.values import ValueProblem, convert

TEXTS = (("serial", "serial", ""), (CIRCLE, "kind", ""), (MEMORY, "limits", ""))
RANGES = (("limits.x", "range-x", "m"), ("limits.y", "range-y", "m"), ("limits.yaw", "range-yaw", "deg"))
CONSTANTS = tuple(
    (f"axes.{axis}.{what}", f"{what}-{axis}", unit)
    for axis, density in (("x", "steps/m"), ("y", "steps/m"), ("yaw", "steps/deg"))
    for what, unit in (("steps", density), ("offset", "steps"))
)
"""The rig's settings that are flags of the gantry: key, flag, unit."""


def flags(rig: Rig) -> list[str]:
    """The rig's port, kind, limits and constants as the gantry's flags; raises UsageError for an invalid one."""
    found = []
    for key, flag, unit in (*TEXTS, *RANGES, *CONSTANTS):
        entry = rig.entry(key)
        if entry is None or not isinstance(entry.value, Scalar):
            continue
        text = entry.value.text if not unit else _number(entry.value, flag, unit)
        found.append(f"--{flag}={text}")
    return found


def motion(rig: Rig) -> Motion:
    """The rig's motion by these flags."""
    return motion_of(dict(word.removeprefix("--").split("=", 1) for word in flags(rig)), manual=True)


def _number(value: Scalar, flag: str, unit: str) -> str:
    try:
        return convert(Parameter(name=flag, type="number", unit=unit, help=""), value, Path.cwd()).text
    except ValueProblem as problem:
        raise UsageError(f"{flag}: {problem}") from None
