"""Processes under measurement, services of ours and cluon's tools: the processor time and memory that they take."""

import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, NamedTuple

from dodo_dsl import __version__

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ("sandbox", "clock", "collision", "dynamic-model", "integrator", "rec-recorder", "virtual-camera")
"""Those of a closed loop."""
_MEASURE = """
import os, sys, time
begin = time.perf_counter()
child = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ, file_actions=[(os.POSIX_SPAWN_DUP2, 2, 1)])
_, status, usage = os.wait4(child, 0)
seconds, processor = time.perf_counter() - begin, usage.ru_utime + usage.ru_stime
print(seconds, usage.ru_maxrss / 1024, processor, os.waitstatus_to_exitcode(status))
"""


class Measured:
    """A process, and what it took of a processor."""

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self.process = process
        self._last = 0.0

    def processor_time(self) -> float:
        """Seconds so far, of all threads; once it has ended, what was seen last."""
        with suppress(OSError):
            threads = Path(f"/proc/{self.process.pid}/task").glob("*/schedstat")
            self._last = max(self._last, sum(int(thread.read_text().split()[0]) for thread in threads) / 1e9)
        return self._last


class Cost(NamedTuple):
    """Seconds that pass, peak memory in MiB, and seconds of processors."""

    seconds: float
    memory: float
    processor: float


def cost_of(command: Sequence[str | Path], folder: Path) -> Cost:
    """What a program costs, by its path; raises RuntimeError with its output when it fails.

    A small process starts it, as Linux counts the memory of the one that starts a program as the program's own.
    """
    words = [sys.executable, "-ISc", _MEASURE, *map(str, command)]
    found = subprocess.run(words, cwd=folder, check=True, capture_output=True, text=True)
    *numbers, code = map(float, found.stdout.split())
    if code:
        raise RuntimeError(f"{' '.join(map(str, command))} ended with {code:.0f}: {found.stderr.strip()[:500]}")
    return Cost(*numbers)


def engine_problem(images: Sequence[str] = ()) -> str:
    """Why tests cannot run in containers here; empty if they can. ``images`` are names of DoDo's."""
    if shutil.which("docker") is None:
        return "the docker command is missing"
    for words, text in ((["info"], "no Docker engine answers"), (["compose", "version"], "Compose v2 is missing")):
        if subprocess.run(["docker", *words], capture_output=True, check=False).returncode:
            return text
    for image in (f"dodo/{name}:{__version__}" for name in images):
        if subprocess.run(["docker", "image", "inspect", image], capture_output=True, check=False).returncode:
            return f"there is no image {image} (dodo images build)"
    return ""


def finished(command: Sequence[str | Path], folder: Path, environment: dict[str, str] | None = None) -> int:
    """Exit code of a program that stays silent; one that is interrupted with this process may tear down first."""
    null = subprocess.DEVNULL
    process = subprocess.Popen(command, cwd=folder, env=environment, stdout=null, stderr=null)
    try:
        return process.wait()
    finally:
        process.wait()


def tool(name: str) -> Path | None:
    """A tool of libcluon that pycluon brings, if it is installed: the program itself, not the script that calls it."""
    package = importlib.util.find_spec("pycluon")
    path = Path(package.origin).parent / "bin" / name if package and package.origin else Path()
    return path if path.is_file() else None


@contextmanager
def service(module: str, folder: Path, *flags: str) -> Iterator[Measured]:
    """A service of ours, ready."""
    command = [sys.executable, "-m", f"services.{module}", *flags]
    with _ended(command, dict(os.environ), subprocess.PIPE) as measured:
        assert measured.process.stdout is not None
        if not measured.process.stdout.readline():
            raise RuntimeError(f"{module} did not start")
        yield measured


@contextmanager
def peer(command: Sequence[str | Path], output: int | IO[bytes] = subprocess.DEVNULL) -> Iterator[Measured]:
    """A tool of libcluon, started."""
    with _ended(command, dict(os.environ), output) as measured:
        yield measured


@contextmanager
def _ended(command: Sequence[str | Path], environment: dict[str, str], output: int | IO[bytes]) -> Iterator[Measured]:
    process = subprocess.Popen(command, cwd=ROOT, env=environment, stdout=output, stderr=subprocess.DEVNULL)
    try:
        yield Measured(process)
    finally:
        process.terminate()
        process.wait()
