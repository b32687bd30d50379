import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[3]
PATIENCE = 20.0


class Process:
    """A service as a process; every reading of its output has a limit in time.

    What it says of updates that came late is left out: they are the machine's.
    """

    def __init__(self, argv: list[str], **environment: str) -> None:
        self.process = subprocess.Popen(
            argv,
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._unread = b""

    def line(self) -> Any:
        """The next line of its output, decoded."""
        assert self.process.stdout is not None
        while True:
            line, is_whole, rest = self._unread.partition(b"\n")
            if is_whole:
                self._unread = rest
                if not _is_late(line):
                    return json.loads(line)
                continue
            assert select.select([self.process.stdout], [], [], PATIENCE)[0], "the service is silent"
            data = os.read(self.process.stdout.fileno(), 65_536)
            assert data, "the service ended"
            self._unread += data

    def stop(self) -> None:
        self.process.send_signal(signal.SIGTERM)

    def end(self) -> tuple[int, str, str]:
        """Exit code, what is left of standard output, and standard error."""
        out, err = self.process.communicate(timeout=PATIENCE)
        left = (self._unread.decode() + out).splitlines(keepends=True)
        return self.process.returncode, "".join(line for line in left if not _is_late(line.encode())), err


def _is_late(line: bytes) -> bool:
    return line.startswith(b'{"dodo": "late"')


Start = Callable[..., Process]


@pytest.fixture
def start(cid: int) -> Iterator[Start]:
    """Starts the tiny service on the session of the test."""
    processes: list[Process] = []

    def start_one(*flags: str, **environment: str) -> Process:
        argv = [sys.executable, str(Path(__file__).with_name("tiny") / "__main__.py"), f"--cid={cid}", *flags]
        processes.append(Process(argv, **environment))
        return processes[-1]

    yield start_one
    for process in processes:
        process.process.kill()
        process.process.communicate()
