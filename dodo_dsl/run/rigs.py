"""Rigs: a rig by hand through its service's program, its lease, and the quarantine of one that is not fit."""

import asyncio
import contextlib
import json
import os
import re
import signal
import time
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from typing import Any

from dodo_dsl.plan.model import Plan
from dodo_dsl.run import leases
from dodo_dsl.run.environment import base_environment
from dodo_dsl.run.events import BackendError
from dodo_dsl.run.process import package_path
from dodo_dsl.spec.rig import EMULATED

FOLDER_VARIABLE = "DODO_RIGS"
PATIENCE_S = 180.0
_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")
_END_S = 5.0


class RigProblem(Exception):
    """The rig cannot do it; ``usage`` when it was asked for what it must not do."""

    def __init__(self, text: str, usage: bool = False) -> None:
        super().__init__(text)
        self.usage = usage


class NoAnswer(RigProblem):
    """The rig's program did not run as it should, which says nothing about the rig."""


def folder() -> Path:
    """``DODO_RIGS``, else a folder of this user's state (XDG base directories)."""
    state = os.environ.get("XDG_STATE_HOME") or "~/.local/state"
    return Path(os.environ.get(FOLDER_VARIABLE) or Path(state).expanduser() / "dodo" / "rigs")


def _file(rig: str) -> Path:
    if not _NAME.fullmatch(rig):
        raise RigProblem(f"'{rig}' is no rig's name")
    return folder() / f"{rig}.json"


def quarantined(rig: str) -> str:
    """Why a rig is in quarantine; empty when it is not."""
    try:
        text = _file(rig).read_text(encoding="utf-8")
    except FileNotFoundError:
        return ""
    with contextlib.suppress(ValueError, KeyError, TypeError):
        return str(json.loads(text)["reason"])
    return "its file of state cannot be read"


def all_quarantined() -> dict[str, str]:
    """The rigs in quarantine, each with its reason."""
    return {path.stem: quarantined(path.stem) for path in sorted(folder().glob("*.json")) if _NAME.fullmatch(path.stem)}


def quarantine(rig: str, reason: str) -> None:
    """Tests on the rig end in error from now on."""
    path = _file(rig)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(f".{os.getpid()}.part")
    part.write_text(json.dumps({"rig": rig, "reason": reason, "when": int(time.time())}) + "\n", encoding="utf-8")
    part.replace(path)


def clear(rig: str) -> bool:
    """Ends a quarantine; whether there was one."""
    held = _file(rig).exists()
    _file(rig).unlink(missing_ok=True)
    return held


@contextlib.asynccontextmanager
async def leased(
    cid: int | None, what: str, say: Callable[[str], None], patience_s: float = leases.DEFAULT_PATIENCE_S
) -> AsyncIterator[tuple[int, ...]]:
    """The lease that tests on the rig take, too: that of its CID. The emulated rig has none, as everyone has their own.

    Gives the descriptors by which a program holds it, too. Raises LeaseTimeout when it does not come free.
    """
    if cid is None:
        yield ()
        return
    lease = await leases.lease_any([f"cid-{cid}"], {"test": what}, say, patience_s=patience_s)
    try:
        yield (lease.descriptor,)
    finally:
        lease.release()


async def ask(
    program: Sequence[str], words: Sequence[str], patience_s: float = PATIENCE_S, descriptors: tuple[int, ...] = ()
) -> dict[str, Any]:
    """What a rig's program answers; it is told to end, so that it stops the rig, when the caller is. RigProblem."""
    environment = {**base_environment(), "PYTHONPATH": package_path()}
    process = await asyncio.create_subprocess_exec(
        *program,
        *words,
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        env=environment,
        start_new_session=True,
        pass_fds=descriptors,
    )
    try:
        async with asyncio.timeout(patience_s):
            out, err = await process.communicate()
    except TimeoutError:
        raise NoAnswer(f"the rig's program gave no answer within {patience_s:g} s") from None
    finally:
        await _ended(process)
    try:
        said: dict[str, Any] = json.loads(out)
    except ValueError:
        last = (err.decode(errors="replace").strip().splitlines() or ["it said nothing"])[-1]
        raise NoAnswer(f"the rig's program gave no answer: {last}") from None
    if "error" in said:
        raise RigProblem(str(said["error"]), usage=process.returncode == 2)
    return said


def ask_alone(
    cid: int | None,
    what: str,
    question: tuple[Sequence[str], Sequence[str]],
    say: Callable[[str], None],
    patience_s: float = leases.DEFAULT_PATIENCE_S,
) -> dict[str, Any]:
    """``ask`` a program with its words about a rig that nobody else uses meanwhile; a signal ends both.

    Raises RigProblem and LeaseTimeout.
    """
    try:
        return asyncio.run(_ask_alone(cid, what, question, say, patience_s))
    except asyncio.CancelledError:
        raise KeyboardInterrupt from None


async def _ask_alone(
    cid: int | None,
    what: str,
    question: tuple[Sequence[str], Sequence[str]],
    say: Callable[[str], None],
    patience_s: float,
) -> dict[str, Any]:
    task = asyncio.current_task()
    assert task is not None
    for number in (signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, task.cancel)
    async with leased(cid, what, say, patience_s) as descriptors:
        return await ask(*question, descriptors=descriptors)


async def _ended(process: asyncio.subprocess.Process) -> None:
    if process.returncode is not None:
        return
    with contextlib.suppress(ProcessLookupError):
        process.send_signal(signal.SIGTERM)
    try:
        await asyncio.wait_for(process.wait(), _END_S)
    except TimeoutError:
        process.kill()
        await process.wait()


def is_real(plan: Plan) -> bool:
    """Whether a test runs on hardware, whose CID is its alone."""
    return bool(plan.rig) and plan.rig != EMULATED


async def examine(plan: Plan, say: Callable[[str], None]) -> None:
    """Before a test on a real rig: BackendError when it is in quarantine, or fails its check and is put there."""
    if not is_real(plan):
        return
    try:
        reason = quarantined(plan.rig)
        if not reason:
            say(f"checking rig {plan.rig}")
            reason = await _fault(plan)
            if reason:
                quarantine(plan.rig, reason)
    except RigProblem as problem:
        raise BackendError(str(problem)) from problem
    if reason:
        clearing = f"`dodo rig clear {plan.rig}` ends that"
        raise BackendError(f"rig {plan.rig} is in quarantine: {reason} ({clearing})")


async def _fault(plan: Plan) -> str:
    """What a check of the rig's gantry and camera finds; empty when both are fit."""
    for service in plan.services:
        program = CHECKS.get(service.uses)
        if program is None:
            continue
        module, action, names = program
        if any(flag.kind == "path" and flag.name == "file" for flag in service.flags):
            continue  # a file is alive
        words = [f"--{flag.name}={flag.value}" for flag in service.flags if flag.name in names]
        try:
            said = await ask(("python", "-m", module), [*words, *action])
        except NoAnswer:
            raise
        except RigProblem as problem:
            return str(problem)
        if not said.get("ok"):
            return str(said.get("reason") or "its check failed")
    return ""


HAND = ("python", "-m", "services.gantry.hand")
RANGES = ("range-x", "range-y", "range-yaw")
CHECKS: dict[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "gantry": ("services.gantry.hand", ("check",), ("serial", *RANGES)),
    "camera": ("services.camera.check", (), ("source", "width", "height", "freq", "exposure")),
}
"""For each service that has hardware: the module that checks it, its action, and the test's flags that it takes."""
