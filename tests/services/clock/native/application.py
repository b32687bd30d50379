"""Programs under the library and its agent, alone in PID and network namespaces of their own."""

import json
import os
import platform
import select
import shlex
import shutil
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

ROOT = Path(__file__).parents[4]
SOURCES = ROOT / "services" / "clock" / "native"
SECOND = 10**9
BEGIN = 1_700_000_000 * SECOND
START = BEGIN - 10 * SECOND
PATIENCE_S = 60.0
_HEADERS = ("/usr/include", f"/usr/include/{platform.machine()}-linux-gnu")
"""The kernel's, which musl does not bring."""
NAMESPACES = ["unshare", *(["-U", "-r"] if os.getuid() else []), "-n", "-i", "-p", "-f", "--mount-proc", "--kill-child"]


def compiled(folder: Path, optimization: str = "-O0") -> Path:
    """The folder with the library, the agent and the tests' programs."""
    words = ["make", "-s", "-C", str(SOURCES), f"BUILD={folder}", f"CFLAGS={optimization}"]
    subprocess.run(words, check=True, timeout=PATIENCE_S)
    programs = Path(__file__).with_name("programs.c")
    subprocess.run(["cc", "-pthread", "-o", folder / "programs", programs], check=True, timeout=PATIENCE_S)
    if shutil.which("musl-gcc"):  # what musl lacks, the library has
        headers = [word for path in _HEADERS for word in ("-idirafter", path)]
        words = ["musl-gcc", "-w", *headers, "-Wl,--unresolved-symbols=ignore-in-shared-libs", "-o", folder / "musl"]
        subprocess.run([*words, programs, folder / "libdodo-time.so"], check=True, timeout=PATIENCE_S)
    return folder


def refusal() -> str:
    """Why these tests cannot run here; empty when they can."""
    try:
        subprocess.run(
            [*NAMESPACES, "ip", "link", "set", "lo", "up"], check=True, capture_output=True, timeout=PATIENCE_S
        )
        subprocess.run(["cc", "--version"], check=True, capture_output=True, timeout=PATIENCE_S)
    except (OSError, subprocess.CalledProcessError) as error:
        return f"needs a C compiler and namespaces: {error}"
    return ""


class Application:
    """Services, each a command, whose time a test lets go on."""

    def __init__(self, built: Path, *services: Sequence[str | Path], seed: int = 0) -> None:
        self._scratch = tempfile.TemporaryDirectory(prefix="dodo-time-", dir="/dev/shm")
        self._outputs = Path(self._scratch.name)
        self.folder = self._outputs / "time"
        ours = f"LD_PRELOAD={built / 'libdodo-time.so'} DODO_TIME={self.folder} PYTHONHASHSEED=0"
        agent = f"{built / 'dodo-time'} --folder={self.folder} --services={len(services)} --seed={seed}"
        lines = ["ip link set lo up", "ip route add 224.0.0.0/4 dev lo src 127.0.0.1"]
        lines += [
            f"{agent} --start={START} --begin={BEGIN} > {self._outputs}/agent &",
            f"until [ -e {self.folder}/ready ]; do sleep 0.01; done",
        ]
        for number, words in enumerate(services):
            command = shlex.join(map(str, words))
            done = f"echo $? > {self._outputs}/code{number}"
            lines.append(
                f"(env DODO_TIME_SERVICE={number} {ours} {command} > {self._outputs}/out{number} 2>&1; {done}) &"
            )
        self._shell = subprocess.Popen([*NAMESPACES, "sh", "-c", "\n".join([*lines, "wait"])], stdin=subprocess.DEVNULL)
        try:
            self._await(self.folder / "ready")
        except AssertionError:
            self._end()
            raise
        self._command = (self.folder / "command").open("wb", buffering=0)
        self._reply = (self.folder / "reply").open("rb", buffering=0)

    def __enter__(self) -> "Application":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._command.close()
        self._reply.close()
        self._end()

    def _end(self) -> None:
        self._shell.kill()
        self._shell.wait(PATIENCE_S)
        self._scratch.cleanup()

    def run(self, seconds: float, key: str = "now") -> dict[str, Any]:
        """Lets time go on to so many seconds after the begin; what the agent says then, or of this key meanwhile."""
        self._command.write(b"run %d\n" % (BEGIN + round(seconds * SECOND)))
        while True:
            readable, _, _ = select.select([self._reply], [], [], PATIENCE_S)
            assert readable, "the agent does not answer"
            reply: dict[str, Any] = json.loads(self._reply.readline())
            if key in reply:
                return reply

    def output(self, service: int = 0) -> str:
        return (self._outputs / f"out{service}").read_text()

    def code(self, service: int = 0) -> int:
        """The exit code of a service that ends."""
        code = self._outputs / f"code{service}"
        self._await(code)
        while not code.read_text():
            time.sleep(0.001)
        return int(code.read_text())

    def _await(self, path: Path) -> None:
        end = time.monotonic() + PATIENCE_S
        while not path.exists():
            assert self._shell.poll() is None and time.monotonic() < end, f"{path} does not come: {self._said()}"
            time.sleep(0.001)

    def _said(self) -> str:
        return "".join(path.read_text() for path in self._outputs.glob("out*"))
