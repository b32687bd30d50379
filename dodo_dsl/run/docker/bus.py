"""Announces the begin of a test on its bus: through its sandbox container, or on the host."""

import asyncio
from typing import Any

from dodo_dsl.opendlv.bus.address import group
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.run.services.announce import begin_frame, send_on_host

# dd makes one datagram of it: bash itself would write one a line, and a frame may hold a line feed
_SEND = 'printf "%b" "$1" | dd bs=65507 iflag=fullblock status=none > "/dev/udp/$2/$3"'


async def announce_begin(cid: int, seed: int, sandbox: Any | None, key: bytes = b"") -> None:
    """Sends ``dodo.TestBegin`` in the network of the sandbox container, or of the host; raises BackendError."""
    frame = begin_frame(seed, key=key)
    problem = _host_problem(cid, frame) if sandbox is None else await asyncio.to_thread(_problem, sandbox, cid, frame)
    if problem:
        raise BackendError(f"the begin of the test cannot be announced on its bus: {problem}")


def _host_problem(cid: int, frame: bytes) -> str:
    try:
        send_on_host(cid, frame)
    except OSError as error:
        return str(error)
    return ""


def _problem(sandbox: Any, cid: int, frame: bytes) -> str:
    """Why the command in the sandbox container failed; empty when it did not."""
    from docker.errors import DockerException

    escaped = "".join(f"\\x{byte:02x}" for byte in frame)
    host, port = group(cid)
    words = ["bash", "-c", _SEND, "send", escaped, host, str(port)]
    try:
        code, output = sandbox.exec_run(words)
    except (DockerException, OSError) as error:
        return str(error)
    return "" if code == 0 else (output or b"").decode("utf-8", "replace").strip() or f"exit code {code}"
