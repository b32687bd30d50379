import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[3]
LATE = '{"dodo": "late"'


class Process:
    """A service as a process. What it says of updates that came late is left out: they are the machine's."""

    def __init__(self, argv: list[str], **environment: str) -> None:
        self.process = subprocess.Popen(
            argv,
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def line(self) -> Any:
        """The next line of its output, decoded."""
        assert self.process.stdout is not None
        while (line := self.process.stdout.readline()).startswith(LATE):
            pass
        assert line, "the service ended"
        return json.loads(line)

    def stop(self) -> None:
        self.process.send_signal(signal.SIGTERM)

    def end(self) -> tuple[int, str, str]:
        """Exit code, what is left of standard output, and standard error."""
        assert self.process.stdout is not None and self.process.stderr is not None
        out, err = self.process.stdout.readlines(), self.process.stderr.read()
        return self.process.wait(), "".join(line for line in out if not line.startswith(LATE)), err


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
