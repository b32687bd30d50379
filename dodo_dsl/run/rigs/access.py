"""Manual access to a rig and its camera through their programs, while nobody else uses the rig."""

import asyncio
import contextlib
import json
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dodo_dsl.diagnostics import shown_path
from dodo_dsl.plan.added_services import CAMERA, DRAWN, hardware
from dodo_dsl.plan.model import Flag, PlannedService
from dodo_dsl.run.process.environment import base_environment
from dodo_dsl.run.process.slot import package_path
from dodo_dsl.run.rigs.leases import leased
from dodo_dsl.run.rigs.problems import ProgramTimeout, RigProblem
from dodo_dsl.spec.arguments import Argument, ValueProblem, convert, default_value, resolved
from dodo_dsl.spec.manifest import Manifest, Parameter, load_manifests
from dodo_dsl.spec.model import Spec, Use
from dodo_dsl.spec.rig import Rig

MANUAL = ("python", "-m", "services.gantry.manual")
PATIENCE_S = 180.0
Command = tuple[Sequence[str], Sequence[str]]
_END_S = 5.0


async def query(
    program: Sequence[str], words: Sequence[str], patience_s: float = PATIENCE_S, descriptors: tuple[int, ...] = ()
) -> dict[str, Any]:
    """The JSON object that a rig's program prints; raises RigProblem.

    When the caller is cancelled, the program gets SIGTERM, upon which it stops the rig; when the caller is killed, its
    standard input ends, with the same effect. ``descriptors`` are those of leases that the program holds, too.
    """
    process = await asyncio.create_subprocess_exec(
        *program,
        *words,
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        env={**base_environment(), "PYTHONPATH": package_path()},
        start_new_session=True,
        pass_fds=descriptors,
    )
    assert process.stdout is not None and process.stderr is not None
    try:
        async with asyncio.timeout(patience_s):
            out, err = await asyncio.gather(process.stdout.read(), process.stderr.read())
            code = await process.wait()
    except TimeoutError:
        raise ProgramTimeout(f"the rig's program gave no answer within {patience_s:g} s") from None
    finally:
        await _end(process)
    return _answer(out, err, code)


def _answer(out: bytes, err: bytes, code: int | None) -> dict[str, Any]:
    try:
        answer: dict[str, Any] = json.loads(out)
    except ValueError:
        last = (err.decode(errors="replace").strip().splitlines() or ["no output"])[-1]
        raise RigProblem(f"the rig's program gave no answer: {last}") from None
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


@contextlib.contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Within the block, a signal that ends this process cancels its task."""
    loop, task = asyncio.get_running_loop(), asyncio.current_task()
    assert task is not None
    for number in (signal.SIGTERM, signal.SIGHUP):
        loop.add_signal_handler(number, task.cancel)
    try:
        yield
    finally:
        for number in (signal.SIGTERM, signal.SIGHUP):
            loop.remove_signal_handler(number)


@contextlib.contextmanager
def occupied(
    cid: int | None, user: str, devices: Sequence[str], say: Callable[[str], None], patience_s: float
) -> Iterator[Callable[[Command], dict[str, Any]]]:
    """For queries with a program and its words, while and between which nobody else uses the rig; a signal ends each.

    ``user`` names the holder of the leases to others. Raises LeaseTimeout, and the queries RigProblem.
    """
    with asyncio.Runner() as runner, contextlib.ExitStack() as held:
        leasing = leased(cid, user, say, patience_s, devices)
        descriptors = runner.run(leasing.__aenter__())
        held.callback(lambda: runner.run(leasing.__aexit__(None, None, None)))

        async def asked(command: Command) -> dict[str, Any]:
            with _ended_by_signals():
                return await query(*command, descriptors=descriptors)

        def ask(command: Command) -> dict[str, Any]:
            try:
                return runner.run(asked(command))
            except asyncio.CancelledError:
                raise KeyboardInterrupt from None

        yield ask


PROGRAMS = {
    CAMERA: ("python", "-m", "services.camera.health_check"),
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
        given = list(resolved(spec, use, manifest, rig, {}).arguments.values())
    else:
        given = [_of_rig(rig, parameter) for parameter in manifest.parameters.values()]
    _refuse_invalid(given)
    values = ((argument.parameter.name, argument.value) for argument in given if argument.value)
    return tuple(Flag(name, str(value.path or value.text)) for name, value in values)


def _refuse_invalid(given: Sequence[Argument]) -> None:
    for argument in given:
        if argument.problem:
            span = argument.problem.span
            text = f"{shown_path(span.file)}:{span.line}:{span.column}: {argument.problem.message}"
            raise RigProblem(text, usage=True)


def _of_rig(rig: Rig, parameter: Parameter) -> Argument:
    entry = rig.entry(parameter.rig) if parameter.rig else None
    if entry is None:
        return Argument(parameter, None, default_value(parameter))
    try:
        return Argument(parameter, entry, convert(replace(parameter, name=parameter.rig), entry.value, Path.cwd()))
    except ValueProblem as problem:
        return Argument(parameter, entry, None, problem.diagnostic)


def flags(rig: Rig) -> list[str]:
    """The rig's port, kind, limits and constants as the gantry's flags; raises RigProblem for an invalid one."""
    found = [_of_rig(rig, parameter) for parameter in load_manifests()[0]["gantry"].parameters.values()]
    _refuse_invalid(found)
    return [f"--{given.parameter.name}={given.value.text}" for given in found if given.entry and given.value]
