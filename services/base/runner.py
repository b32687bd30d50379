"""What a service reports to the runner: over the test's channel, or by lines of its output where no runner listens."""

import json
from contextlib import suppress
from pathlib import Path

from dodo_dsl.opendlv.packets import RUNNER_SOCKET, Connection

_runner: Connection | None = None


def connect(folder: Path | None, service: str) -> None:
    """From now on a runner that listens in the folder hears what is reported."""
    global _runner  # noqa: PLW0603  (a process is one service)
    with suppress(OSError):  # run by hand, or by an engine on another machine
        _runner = Connection.open(folder / RUNNER_SOCKET, service) if folder else None


def tell(kind: str, **facts: object) -> None:
    """Reports something of a kind to the runner, one that ``dodo_dsl/run/protocol.py`` knows."""
    say(json.dumps({"dodo": kind, **facts}))


def say(message: str) -> None:
    """As ``tell``, with a message that is written already."""
    if _runner is None or not _runner.send(message.encode()):
        print(message, flush=True)
