"""What gives an application the test's time in lockstep, a preloaded library and an agent, and who cannot have it."""

import contextlib
import fcntl
import functools
import hashlib
import os
import platform
import shutil
import stat
import struct
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.plan.added_services import OWN_TIME, TIME, agent_flags, time_variables
from dodo_dsl.plan.model import Plan
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.state_folder import cache_home, secured

LIBRARY, AGENT = "libdodo-time.so", "dodo-time"
PAGE_DESTROYED = 3
"""The exit code of the agent when the application destroyed the page that both share."""
POSIX_MEMORY = "CLUON_SHAREDMEMORY_POSIX"
_BUILD_S = 120.0
_OF_MAKE = ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")
"""Variables by which a make that has started DoDo would speak to this one."""


@dataclass(frozen=True)
class ApplicationTime:
    library: Path
    agent: Path

    def words(self, plan: Plan, folder: str, *, on_host: bool) -> tuple[str, ...]:
        """The agent's command, for a sandbox whose applications have their own process namespaces."""
        flags = agent_flags(plan.application.services, plan.seed, folder)
        return (str(self.agent), *flags, "--nested", *(("--by-environment",) if on_host else ()))

    def variables(self, given: Mapping[str, str], plan: Plan, service: str, folder: str) -> dict[str, str]:
        number = [each.name for each in plan.application.services].index(service)
        return time_variables(given, number, plan.seed, str(self.library), folder)


def folder_of(slot: str) -> str:
    """Where library and agent meet; on the host, by the name of the test's slot."""
    return f"/dev/shm/{slot}{TIME.partition('-')[2]}" if slot else OWN_TIME


@functools.cache
def built() -> ApplicationTime:
    """What ``scripts/setup`` has built, or else builds it in the user's cache; raises BackendError."""
    sources = package_data.services() / "clock" / "native"
    files = sorted(path for path in sources.iterdir() if path.suffix in (".c", ".h") or path.name == "Makefile")
    if checkout := package_data.checkout():
        made = [(checkout / "build" / "time" / name).resolve() for name in (LIBRARY, AGENT)]
        if _is_ready(made[0].parent) and min(map(_changed, made)) >= max(map(_changed, files)):
            return ApplicationTime(*made)
    digest = hashlib.sha256(b"\0".join([platform.machine().encode(), *(path.read_bytes() for path in files)]))
    try:
        folder = secured(secured(cache_home() / "dodo") / f"time-{digest.hexdigest()[:16]}").resolve()
    except (OSError, KeyError) as error:
        raise BackendError(f"DoDo's library needs a cache folder of this user: {error}") from None
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not _is_ready(folder):
            _build(sources, folder)
            folder.chmod(0o755)  # programs of other users load it
    return ApplicationTime(folder / LIBRARY, folder / AGENT)


def _changed(path: Path) -> int:
    return path.stat().st_mtime_ns


def _is_ready(folder: Path) -> bool:
    own, *others = (_machine(_head(path, 20)) for path in (Path("/proc/self/exe"), folder / AGENT, folder / LIBRARY))
    return all(other == own for other in others)


def _build(sources: Path, folder: Path) -> None:
    if not shutil.which("make") or not shutil.which(os.environ.get("CC", "cc")):
        raise BackendError("DoDo's library needs a C compiler and make: apt-get install gcc make, or run scripts/setup")
    words = ["make", "--silent", "-C", str(sources), f"BUILD={folder}"]
    environment = {name: value for name, value in os.environ.items() if name not in _OF_MAKE}
    try:
        subprocess.run(words, capture_output=True, text=True, check=True, timeout=_BUILD_S, env=environment)
    except (OSError, subprocess.SubprocessError) as error:
        for name in (LIBRARY, AGENT):
            (folder / name).unlink(missing_ok=True)
        said = error.stderr.split("\n") if isinstance(error, subprocess.CalledProcessError) else []
        why = next((line.strip() for line in said if line.strip()), str(error))
        raise BackendError(f"DoDo's library cannot be built: {why}") from None


_INTERPRETER, _NOTE = 3, 4
"""Types of program headers: one that names the dynamic linker, and one with notes (elf(5))."""
_LONGEST_CHAIN = 4
HEAD_SIZE = 1 << 16


def _machine(head: bytes) -> bytes:
    """Class, byte order and processor by an ELF header; empty for anything else."""
    return head[4:6] + head[18:20] if head[:4] == b"\x7fELF" else b""


def _head(path: Path, size: int) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(size)
    except OSError:
        return b""


Look = Callable[[Path], tuple[int, bytes] | None]
"""The mode and the first bytes of a program, None where there is none at a path."""


def on_this_machine(path: Path) -> tuple[int, bytes] | None:
    """As Look, for a program that is started as a process."""
    with contextlib.suppress(OSError, ValueError):
        if stat.S_ISREG(mode := path.stat().st_mode) and os.access(path, os.X_OK):
            return mode, _head(path, HEAD_SIZE)
    return None


def refusal(service: str, name: str, environment: Mapping[str, str], folder: Path, look: Look = on_this_machine) -> str:
    """Why a service whose program has this ``name`` cannot have the test's time; empty where nothing says so."""
    if environment.get(POSIX_MEMORY) == "1":
        return f"service '{service}' waits for frames in shared memory of POSIX ({POSIX_MEMORY}=1)"
    folders = [folder] if "/" in name else map(Path, environment.get("PATH", os.defpath).split(os.pathsep))
    places = [each / name for each in folders]
    for _ in range(_LONGEST_CHAIN):
        program, found = next(((place, found) for place in places if (found := look(place))), (None, None))
        if found is None:
            return ""
        if why := _unreachable(*found):
            return f"service '{service}' starts '{program}', {why}"
        words = found[1][2:256].partition(b"\n")[0].decode(errors="replace").split()
        places = [Path(words[0])] if found[1][:2] == b"#!" and words else []
    return ""


def _unreachable(mode: int, head: bytes) -> str:
    if mode & 0o6000:
        return "which changes its user"
    if head[:4] != b"\x7fELF":
        return ""
    if _machine(head) != _machine(_head(Path("/proc/self/exe"), HEAD_SIZE)):
        return "a program for another processor than DoDo's own"
    kinds = set()
    with contextlib.suppress(struct.error, ValueError):  # of a 64-bit file, in this machine's byte order
        (offset,) = struct.unpack_from("=Q", head, 32)
        size, count = struct.unpack_from("=HH", head, 54)
        for start in range(offset, offset + size * count, size):
            kind, place = struct.unpack_from("=I4xQ", head, start)
            kinds.add(kind)
            if kind == _NOTE and head[place + 12 : place + 15] == b"Go\0":
                return "a program of Go, which asks the kernel itself"
    return "" if _INTERPRETER in kinds else "a statically linked program"
