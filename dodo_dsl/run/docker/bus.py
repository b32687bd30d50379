"""Announces the begin of a test to its services: through its sandbox container, or on the host."""

import asyncio
from collections.abc import Sequence
from typing import Any

from dodo_dsl.opendlv.bus.address import Address
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.run.services.announce import begin_frame, send_on_host

# dd makes one datagram of it: bash itself would write one a line, and a frame may hold a line feed
_SEND = (
    'for to in "${@:2}"; do printf "%b" "$1" | dd bs=65507 iflag=fullblock status=none > "/dev/udp/$to" || exit; done'
)


async def announce_begin(seed: int, to: Sequence[Address], sandbox: Any | None, key: bytes = b"") -> None:
    """Sends ``dodo.TestBegin`` in the network of the sandbox container, or of the host; raises BackendError."""
    frame = begin_frame(seed, key=key)
    problem = _host_problem(frame, to) if sandbox is None else await asyncio.to_thread(_problem, sandbox, frame, to)
    if problem:
        raise BackendError(f"the begin of the test cannot be announced to its services: {problem}")


def _host_problem(frame: bytes, to: Sequence[Address]) -> str:
    try:
        send_on_host(frame, to)
    except OSError as error:
        return str(error)
    return ""


def _problem(sandbox: Any, frame: bytes, to: Sequence[Address]) -> str:
    """Why the command in the sandbox container failed; empty when it did not."""
    from docker.errors import DockerException

    escaped = "".join(f"\\x{byte:02x}" for byte in frame)
    words = ["bash", "-c", _SEND, "send", escaped, *(f"{host}/{port}" for host, port in to)]
    try:
        code, output = sandbox.exec_run(words)
    except (DockerException, OSError) as error:
        return str(error)
    return "" if code == 0 else (output or b"").decode("utf-8", "replace").strip() or f"exit code {code}"
