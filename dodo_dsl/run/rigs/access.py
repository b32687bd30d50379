"""Manual access to a rig through its service's program, while nobody else uses the rig."""

import asyncio
import contextlib
import json
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from dodo_dsl.run import leases
from dodo_dsl.run.process.environment import base_environment
from dodo_dsl.run.process.python_path import package_path
from dodo_dsl.run.rigs.problems import NoAnswer, ProgramTimeout, RigProblem
from dodo_dsl.run.rigs.rig_leases import devices_in, leased, release, taken

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
