"""Manual access to a rig and its camera through their programs, while nobody else uses the rig.

A rig's settings become flags of the programs that move it, and limits that its operator permits.
"""

import asyncio
import contextlib
import json
import os
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dodo_dsl.diagnostics import shown_path
from dodo_dsl.plan.added_services import CAMERA, DRAWN, hardware
from dodo_dsl.plan.model import Flag, PlannedService
from dodo_dsl.run import leases
from dodo_dsl.run.process.environment import base_environment
from dodo_dsl.run.process.slot import package_path
from dodo_dsl.run.rigs.leases import devices_in, leased, release, taken
from dodo_dsl.run.rigs.permission import Motion, motion_of
from dodo_dsl.run.rigs.problems import NoAnswer, ProgramTimeout, RigProblem
from dodo_dsl.source import Scalar
from dodo_dsl.spec.arguments import Argument, ValueProblem, convert, default_value, resolved
from dodo_dsl.spec.manifest import Manifest, Parameter, load_manifests
from dodo_dsl.spec.model import Spec, Use
from dodo_dsl.spec.rig import CIRCLE, MEMORY, Rig

MANUAL = ("python", "-m", "services.gantry.manual")
PATIENCE_S = 180.0
Command = tuple[Sequence[str], Sequence[str]]
"""A rig's program, and its words."""
_END_S = 5.0


async def query(
    program: Sequence[str], words: Sequence[str], patience_s: float = PATIENCE_S, descriptors: tuple[int, ...] = ()
) -> dict[str, Any]:
    """The JSON object that a rig's program prints; raises RigProblem.

    When the caller is cancelled, the program gets SIGTERM, upon which it stops the rig; when the caller is killed, its
    standard input ends, with the same effect. ``descriptors`` are those of leases that the program holds, too.
    """
    with _sign_of_life() as alive:
        return await _query(program, words, patience_s, descriptors, alive)


@contextlib.contextmanager
def _sign_of_life() -> Iterator[int]:
    """The reading end of a pipe that ends with the block, or with this process."""
    reader, writer = os.pipe()
    try:
        yield reader
    finally:
        os.close(writer)
        os.close(reader)


async def _query(
    program: Sequence[str], words: Sequence[str], patience_s: float, descriptors: tuple[int, ...], alive: int
) -> dict[str, Any]:
    process = await asyncio.create_subprocess_exec(
        *program,
        *words,
        stdin=alive,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        env={**base_environment(), "PYTHONPATH": package_path()},
        start_new_session=True,
        pass_fds=descriptors,
    )
    try:
        async with asyncio.timeout(patience_s):
            out, err = await process.communicate()
    except TimeoutError:
        raise ProgramTimeout(f"the rig's program gave no answer within {patience_s:g} s") from None
    finally:
        await _end(process)
    return _answer(out, err, process.returncode)


def _answer(out: bytes, err: bytes, code: int | None) -> dict[str, Any]:
    try:
        answer: dict[str, Any] = json.loads(out)
    except ValueError:
        last = (err.decode(errors="replace").strip().splitlines() or ["no output"])[-1]
        raise NoAnswer(f"the rig's program gave no answer: {last}") from None
    if "error" in answer:
        raise RigProblem(str(answer["error"]), usage=code == 2)
    return answer


async def _end(process: asyncio.subprocess.Process) -> None:
    if process.returncode is not None:
        return
    with contextlib.suppress(ProcessLookupError):
        process.send_signal(signal.SIGTERM)
    try:
        await asyncio.wait_for(process.wait(), _END_S)
    except TimeoutError:
        process.kill()
        await process.wait()


def query_exclusively(
    cid: int | None,
    user: str,
    command: Command,
    say: Callable[[str], None],
    patience_s: float = leases.DEFAULT_PATIENCE_S,
) -> dict[str, Any]:
    """``query`` with a program and its words, while nobody else uses the rig; a signal ends both.

    ``user`` names the holder of the lease to others. Raises RigProblem and LeaseTimeout.
    """
    try:
        return asyncio.run(_query_exclusively(cid, user, command, say, patience_s))
    except asyncio.CancelledError:
        raise KeyboardInterrupt from None


async def _query_exclusively(
    cid: int | None,
    user: str,
    command: Command,
    say: Callable[[str], None],
    patience_s: float,
) -> dict[str, Any]:
    _end_with_signals()
    async with leased(cid, user, say, patience_s, devices_in(command[1])) as descriptors:
        return await query(*command, descriptors=descriptors)


def _end_with_signals() -> None:
    task = asyncio.current_task()
    assert task is not None
    for number in (signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, task.cancel)


@contextlib.contextmanager
def occupied(
    cid: int | None, user: str, devices: Sequence[str], say: Callable[[str], None], patience_s: float
) -> Iterator[Callable[[Command], dict[str, Any]]]:
    """For several queries, between which nobody else uses the rig either; a signal ends each.

    Raises LeaseTimeout, the queries RigProblem.
    """
    held = asyncio.run(taken(cid, user, say, patience_s, devices))
    descriptors = tuple(lease.descriptor for lease in held)

    async def asked(command: Command) -> dict[str, Any]:
        _end_with_signals()
        return await query(*command, descriptors=descriptors)

    def ask(command: Command) -> dict[str, Any]:
        try:
            return asyncio.run(asked(command))
        except asyncio.CancelledError:
            raise KeyboardInterrupt from None

    try:
        yield ask
    finally:
        release(held)


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
