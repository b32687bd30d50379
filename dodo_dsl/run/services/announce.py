"""What the runner sends on a test's bus: that everything is ready, and on real rigs that it is still running."""

import asyncio
import contextlib
import logging
import socket
import time
from collections.abc import AsyncIterator, Iterable

from google.protobuf.message import Message

from dodo_dsl.opendlv.bus.address import group
from dodo_dsl.opendlv.bus.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.bus.proof import with_proof
from dodo_dsl.opendlv.messages.message_set import MessageSet

ALIVE_S = 1.0

_log = logging.getLogger(__name__)


def begin_frame(seed: int, application: Iterable[int] = (), key: bytes = b"") -> bytes:
    """``dodo.TestBegin`` as a datagram, with the current time as its sample time, proven by the test's key.

    ``application`` are the process ids of the application's services, where the test's services see them.
    """
    begin = MessageSet.standard().type("dodo.TestBegin")
    now = time.time_ns() // 1000
    return _frame(begin(seed=seed, application=",".join(map(str, application))), now, key)


def _frame(message: Message, now: int, key: bytes) -> bytes:
    messages = MessageSet.standard()
    id_ = messages.id(message)
    return encode_frame(Envelope(id_, with_proof(key, id_, messages.encode(message)), now, 0, now, 0))


def send_on_host(cid: int, frame: bytes) -> None:
    """Sends a datagram to a session on this machine's own network; raises OSError."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(frame, group(cid))


@contextlib.asynccontextmanager
async def heartbeat(cid: int, key: bytes = b"") -> AsyncIterator[None]:
    """Within the block, sends ``dodo.Alive`` each second to a session of this machine, proven by the test's key."""
    task = asyncio.ensure_future(_beat(cid, key))
    try:
        yield
    finally:
        task.cancel()


async def _beat(cid: int, key: bytes) -> None:
    kind = MessageSet.standard().type("dodo.Alive")
    while True:
        try:
            now = time.time_ns() // 1000
            send_on_host(cid, _frame(kind(time=now), now, key))
        except OSError as error:
            _log.warning("cannot send a sign of life to CID %d: %s", cid, error)
        await asyncio.sleep(ALIVE_S)
