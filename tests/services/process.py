"""Services of ours as processes, for tests that talk to them over the bus."""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.session import Session

ROOT = Path(__file__).parents[2]
PATIENCE = 20.0


@contextmanager
def running(module: str, folder: Path, *flags: str) -> Iterator[subprocess.Popen[str]]:
    """`python -m services.<module>`, ready; `folder` takes the ready file. It is killed at the end if it still runs."""
    process = launch(module, folder, *flags)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == '{"dodo": "ready"}\n', process.communicate(timeout=PATIENCE)[1]
        yield process
    finally:
        process.kill()
        process.communicate()


def launch(module: str, folder: Path, *flags: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", f"services.{module}", *flags],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def receive(session: Session, name: str, sender_stamp: int = 0) -> tuple[Envelope, Any]:
    """The next message of a name and sender stamp, with its envelope."""
    end = time.monotonic() + PATIENCE
    while True:
        envelope = session.receive(max(0.0, end - time.monotonic()))
        assert envelope is not None, f"no {name} came"
        if (envelope.data_type, envelope.sender_stamp) == (session.messages.id(name), sender_stamp):
            return envelope, session.messages.decode(envelope.data_type, envelope.payload)


def send(session: Session, name: str, sender_stamp: int = 0, sample_time: int | None = None, **fields: Any) -> None:
    session.send(session.messages.type(name)(**fields), sample_time, sender_stamp)
