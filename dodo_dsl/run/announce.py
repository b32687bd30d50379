"""What the runner tells a test's bus: that everything is ready, and on real rigs that it is still there."""

import asyncio
import contextlib
import logging
import socket
import time
from collections.abc import AsyncIterator

from google.protobuf.message import Message

from dodo_dsl.opendlv.bus.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.messages.message_set import MessageSet

ALIVE_S = 1.0
_PORT = 12175

_log = logging.getLogger(__name__)


def begin_frame(seed: int) -> bytes:
    """``dodo.TestBegin`` as a datagram, sampled now."""
    return _frame(MessageSet.standard().type("dodo.TestBegin")(seed=seed))


def _frame(message: Message) -> bytes:
    messages = MessageSet.standard()
    now = time.time_ns() // 1000
    return encode_frame(Envelope(messages.id(message), messages.encode(message), now, 0, now, 0))


def send_on_host(cid: int, frame: bytes) -> None:
    """To a session on this machine's own network; raises OSError."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(frame, (f"225.0.0.{cid}", _PORT))


@contextlib.asynccontextmanager
async def signs_of_life(cid: int) -> AsyncIterator[None]:
    """Meanwhile a session of this machine hears each second that the runner is there."""
    task = asyncio.ensure_future(_live(cid))
    try:
        yield
    finally:
        task.cancel()


async def _live(cid: int) -> None:
    kind = MessageSet.standard().type("dodo.Alive")
    while True:
        try:
            send_on_host(cid, _frame(kind()))
        except OSError as error:
            _log.warning("CID %d cannot be told that the runner is there: %s", cid, error)
        await asyncio.sleep(ALIVE_S)
