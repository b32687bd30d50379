"""Rigs: a rig by hand through its service's program, its lease, and the quarantine of one that is not fit."""

import asyncio
import contextlib
import json
import os
import re
import signal
import stat
import time
from collections.abc import AsyncIterator, Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from dodo_dsl.plan.model import Plan
from dodo_dsl.run import leases
from dodo_dsl.run.announce import signs_of_life
from dodo_dsl.run.process.backend import package_path
from dodo_dsl.run.process.environment import base_environment
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.spec.rig import EMULATED

FOLDER_VARIABLE = "DODO_RIGS"
PATIENCE_S = 180.0
CHECK_PATIENCE_S, CHECK_TRIES = 90.0, 2
"""s: from the far corner the rig looks for its home for 20 s, and for most of a minute when it does so three times."""
_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")
_END_S = 5.0


class RigProblem(Exception):
    """The rig cannot do it; ``usage`` when it was asked for what it must not do."""

    def __init__(self, text: str, usage: bool = False) -> None:
        super().__init__(text)
        self.usage = usage


class NoAnswer(RigProblem):
    """The rig's program did not run as it should, which says nothing about the rig."""


class Silence(NoAnswer):
    """The rig's program hung, as it does when the rig does."""


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
    cid: int | None,
    what: str,
    say: Callable[[str], None],
    patience_s: float = leases.DEFAULT_PATIENCE_S,
    devices: Sequence[str] = (),
) -> AsyncIterator[tuple[int, ...]]:
    """The leases that tests on the rig take, too: of its CID and its devices. The emulated rig has none.

    Gives the descriptors by which a program holds them, too. Raises LeaseTimeout when one does not come free.
    """
    names = [] if cid is None else [f"cid-{cid}"]
    held: list[leases.Lease] = []
    try:
        for name in [*names, *device_leases(devices)]:
            held.append(await leases.lease_any([name], {"test": what}, say, patience_s=patience_s))
        yield tuple(lease.descriptor for lease in held)
    finally:
        for lease in reversed(held):
            lease.release()


def devices_in(words: Iterable[str]) -> list[str]:
    """The hardware that a program's flags name."""
    return [value for flag, _, value in (word.partition("=") for word in words) if flag in DEVICES]


def device_leases(devices: Sequence[str]) -> list[str]:
    """A lease's name for each device that is there, by its number: two rigs that name one exclude each other."""
    names = set()
    for device in devices:
        with contextlib.suppress(OSError, ValueError):
            found = Path(device).stat()
            if device.startswith("/") and stat.S_ISCHR(found.st_mode):
                names.add(f"device-{os.major(found.st_rdev)}-{os.minor(found.st_rdev)}")
    return sorted(names)


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
        raise Silence(f"the rig's program gave no answer within {patience_s:g} s") from None
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
    async with leased(cid, what, say, patience_s, devices_in(question[1])) as descriptors:
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


@contextlib.asynccontextmanager
async def attended(
    plan: Plan, cid: int, descriptors: tuple[int, ...], say: Callable[[str], None]
) -> AsyncIterator[tuple[int, ...]]:
    """A real rig's devices leased and checked, and its services told that the runner lives; of others nothing is done.

    ``descriptors`` are those of the lease of its CID; gives all by which a program holds the rig. Raises BackendError
    when it is in use, in quarantine, or fails its check.
    """
    if not is_real(plan):
        yield descriptors
        return
    devices = devices_in(f"--{flag.name}={flag.value}" for service in plan.services for flag in service.flags)
    async with contextlib.AsyncExitStack() as stack:
        try:
            more = await stack.enter_async_context(leased(None, plan.slug, say, devices=devices))
        except leases.LeaseTimeout as error:
            raise BackendError(str(error)) from error
        await examine(plan, say, (*descriptors, *more))
        await stack.enter_async_context(signs_of_life(cid))
        yield (*descriptors, *more)


async def examine(plan: Plan, say: Callable[[str], None], descriptors: tuple[int, ...]) -> None:
    """Before a test on a real rig: BackendError when it is in quarantine, cannot be checked, or fails and is put there.

    ``descriptors`` hold the rig's leases, which its checks go on to hold should this process be killed.
    """
    try:
        reason = quarantined(plan.rig)
        if not reason:
            say(f"checking rig {plan.rig}")
            reason = await _fault(plan, descriptors)
            if reason:
                quarantine(plan.rig, reason)
    except RigProblem as problem:
        raise BackendError(f"rig {plan.rig} cannot be checked: {problem}") from problem
    if reason:
        clearing = f"`dodo rig clear {plan.rig}` ends that"
        raise BackendError(f"rig {plan.rig} is in quarantine: {reason} ({clearing})")


async def _fault(plan: Plan, descriptors: tuple[int, ...]) -> str:
    """What a check of the rig's gantry and camera finds unfit; empty when both are fit. Raises RigProblem."""
    for service in plan.services:
        program = CHECKS.get(service.uses)
        if program is None:
            continue
        module, action, names = program
        if any(flag.kind == "path" and flag.name == "file" for flag in service.flags):
            continue  # a file is alive
        words = [f"--{flag.name}={flag.value}" for flag in service.flags if flag.name in names]
        try:
            said = await _checked(("python", "-m", module), [*words, *action], descriptors)
        except Silence as silence:
            return f"its check hung {CHECK_TRIES} times: {silence}"
        if not said.get("ok"):
            return str(said.get("reason") or "its check failed")
    return ""


async def _checked(program: Sequence[str], words: Sequence[str], descriptors: tuple[int, ...]) -> dict[str, Any]:
    """What a check says; one that hangs is tried again, and raises Silence at last."""
    for _ in range(CHECK_TRIES - 1):
        with contextlib.suppress(Silence):
            return await ask(program, words, CHECK_PATIENCE_S, descriptors)
    return await ask(program, words, CHECK_PATIENCE_S, descriptors)


HAND = ("python", "-m", "services.gantry.manual")
DEVICES = ("--serial", "--source")
"""Flags that name hardware."""
RANGES = ("range-x", "range-y", "range-yaw")
CHECKS: dict[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "gantry": ("services.gantry.manual", ("check",), ("serial", *RANGES)),
    "camera": ("services.camera.health_check", (), ("source", "width", "height", "freq", "exposure")),
}
"""For each service that has hardware: the module that checks it, its action, and the test's flags that it takes."""
