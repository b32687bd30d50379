"""What the runner sends on a test's bus: that everything is ready, and on real rigs that it is still running."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator
from pathlib import Path

from google.protobuf.message import Message

from dodo_dsl.opendlv.address_book import HEARTBEAT
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.relay import BUS, Relay
from dodo_dsl.plan.added_services import CLOCK
from dodo_dsl.plan.model import Plan

ALIVE_S = 1.0
TEST_BEGIN = "dodo.TestBegin"


def frame_of(message: Message, sampled: int | None = None) -> bytes:
    """A message of DoDo's as a datagram of now, sampled at a time in us, by default now too."""
    known, now = MessageSet.standard(), time.time_ns() // 1000
    return encode_frame(
        Envelope(known.id(message), known.encode(message), now, 0, now if sampled is None else sampled, 0)
    )


def begin(plan: Plan) -> tuple[bytes, list[str]]:
    """The start of a test, for the services that take it, and for all where the application declares to take it."""
    frame = frame_of(MessageSet.standard().type(TEST_BEGIN)(seed=plan.seed))
    names = [CLOCK] if plan.lockstep else [service.name for service in plan.services]
    is_told = any(word.partition("/")[0] == TEST_BEGIN for word in plan.told)
    return frame, [*names, BUS] if is_told else names


@contextlib.asynccontextmanager
async def heartbeat(cid: int, channel: Path) -> AsyncIterator[None]:
    """Within the block, sends ``dodo.Alive`` each second to a session of this machine; raises OSError."""
    relay = Relay(cid, channel, HEARTBEAT)
    task = asyncio.ensure_future(_beat(relay))
    try:
        yield
    finally:
        task.cancel()
        relay.close()


async def _beat(relay: Relay) -> None:
    kind = MessageSet.standard().type("dodo.Alive")
    while True:
        now = time.time_ns() // 1000
        relay.send(frame_of(kind(time=now), sampled=now))
        await asyncio.sleep(ALIVE_S)
