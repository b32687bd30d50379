"""Manual use of a rig's camera: the program that takes a snapshot, and its flags."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.plan.emulated_rig import CAMERA, DRAWN, hardware
from dodo_dsl.plan.model import Flag, PlannedService
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.spec.arguments import Argument, resolved
from dodo_dsl.spec.deployment.rig import Rig
from dodo_dsl.spec.manifest import Manifest, Parameter
from dodo_dsl.spec.model import Spec, Use
from dodo_dsl.spec.values import ValueProblem, convert, default_value

PROGRAMS = {
    CAMERA: ("python", "-m", "services.camera.snapshot"),
    DRAWN: ("python", "-m", "services.virtual_camera.snapshot"),
}

_OF_WHO_ASKS = ("truth-sender", "truth-classes")
"""What a test says of its true boxes is not what a snapshot is asked for."""


@dataclass(frozen=True)
class SnapshotCommand:
    """A program that takes a snapshot, its words without the output, and whether it renders a scene with its truth."""

    program: tuple[str, ...]
    words: tuple[str, ...]
    is_rendered: bool


def snapshot(rig: Rig, manifests: Mapping[str, Manifest], spec: Spec | None) -> SnapshotCommand:
    """A snapshot as the service ``camera`` of a test sees it, or without a test as the rig is; raises RigProblem."""
    use = next((use for use in spec.uses if use.uses.text == CAMERA), None) if spec else None
    if spec and use is None:
        raise RigProblem(f"test '{spec.title}' has no service '{CAMERA}'", usage=True)
    if use is None and rig.is_emulated:
        raise RigProblem("the emulated rig's camera sees the map of a test: name one with --test", usage=True)
    if use is None and rig.entry("camera.source") is None:
        raise RigProblem(f"rig '{rig.name}' has no camera in dodo.yml", usage=True)
    flags = _flags(rig, manifests[CAMERA], spec, use)
    real = PlannedService("environment", CAMERA, CAMERA, "", PROGRAMS[CAMERA], flags)
    service = hardware(real, manifests, "")
    words = tuple(f"--{flag.name}={flag.value}" for flag in service.flags if flag.name not in _OF_WHO_ASKS)
    return SnapshotCommand(PROGRAMS[service.uses], words, service.uses == DRAWN)


def _flags(rig: Rig, manifest: Manifest, spec: Spec | None, use: Use | None) -> tuple[Flag, ...]:
    if spec and use:
        given = list(resolved(spec, use, manifest, rig).arguments.values())
    else:
        given = [_of_rig(rig, parameter) for parameter in manifest.parameters.values()]
    for argument in given:
        if argument.problem:
            span = argument.problem.span
            raise RigProblem(f"{span.file}:{span.line}:{span.column}: {argument.problem.message}", usage=True)
    values = ((argument.parameter.name, argument.value) for argument in given if argument.value)
    return tuple(Flag(name, str(value.path or value.text)) for name, value in values)


def _of_rig(rig: Rig, parameter: Parameter) -> Argument:
    entry = rig.entry(parameter.rig) if parameter.rig else None
    if entry is None:
        return Argument(parameter, None, default_value(parameter))
    try:
        return Argument(parameter, entry, convert(parameter, entry.value, Path.cwd()))
    except ValueProblem as problem:
        return Argument(parameter, entry, None, problem.diagnostic)


def judged_classes(rig: Rig, manifests: Mapping[str, Manifest], spec: Spec) -> list[str]:
    """The classes that a test evaluates; empty when it names none."""
    texts = (
        resolved(spec, use, manifests[use.uses.text], rig).texts.get("classes", "")
        for use in spec.uses
        if use.layer == "evaluation" and use.uses.text in manifests
    )
    return sorted({name for text in texts for name in text.split(",") if name})
