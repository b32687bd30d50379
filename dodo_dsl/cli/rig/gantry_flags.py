"""A dynamic rig's settings as flags of the programs that move it, and as limits that its operator permits."""

from dataclasses import replace
from pathlib import Path

from dodo_dsl.diagnostics import shown_path
from dodo_dsl.run.rigs.motion import Motion, motion_of
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.source import Scalar
from dodo_dsl.spec.deployment.rig import CIRCLE, MEMORY, Rig
from dodo_dsl.spec.manifest import load_manifests
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
    """The rig's port, kind, limits and constants as the gantry's flags; raises RigProblem for an invalid one."""
    numbers = _numbers(rig)
    found = []
    for key, flag, unit in (*TEXTS, *RANGES, *CONSTANTS):
        entry = rig.entry(key)
        if entry is None or not isinstance(entry.value, Scalar):
            continue
        found.append(f"--{flag}={numbers[key] if unit else entry.value.text}")
    return found


def motion(rig: Rig) -> Motion:
    """The rig's motion by these flags."""
    return motion_of(dict(word.removeprefix("--").split("=", 1) for word in flags(rig)), manual=True)


def _numbers(rig: Rig) -> dict[str, str]:
    """All limits and constants of the rig in the gantry's units, by their keys."""
    found = {}
    for parameter in load_manifests()[0]["gantry"].parameters.values():
        entry = rig.entry(parameter.rig)
        if entry is None or not parameter.rig.startswith(("limits.", "axes.")):
            continue
        try:
            found[parameter.rig] = convert(replace(parameter, name=parameter.rig), entry.value, Path.cwd()).text
        except ValueProblem as problem:
            span = problem.diagnostic.span
            text = f"{shown_path(span.file)}:{span.line}:{span.column}: {problem.diagnostic.message}"
            raise RigProblem(text, usage=True) from None
    return found
