"""What the runner sends on a test's bus: that everything is ready, and on real rigs that it is still running."""

import asyncio
import contextlib
import logging
import socket
import time
from collections.abc import AsyncIterator, Iterable, Mapping

from google.protobuf.message import Message

from dodo_dsl.opendlv.address import Address, group
from dodo_dsl.opendlv.authentication import with_proof
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.plan.added_services import CLOCK
from dodo_dsl.plan.model import Plan

ALIVE_S = 1.0
TEST_BEGIN = "dodo.TestBegin"

_log = logging.getLogger(__name__)


def begin_frame(seed: int, application: Iterable[int] = (), key: bytes = b"") -> bytes:
    """``dodo.TestBegin`` as a datagram, with the current time as its sample time, proven by the test's key.

    ``application`` are the process ids of the application's services, where the test's services see them.
    """
    begin = MessageSet.standard().type(TEST_BEGIN)
    return frame_of(begin(seed=seed, application=",".join(map(str, application))), key=key)


def frame_of(
    message: Message,
    messages: MessageSet | None = None,
    sampled: int | None = None,
    stamp: int = 0,
    key: bytes | None = None,
) -> bytes:
    """A message as a datagram of now, sampled at a time in us, by default now too; with a ``key`` it proves itself."""
    known, now = messages or MessageSet.standard(), time.time_ns() // 1000
    id_, payload = known.id(message), known.encode(message)
    payload = payload if key is None else with_proof(key, id_, payload)
    return encode_frame(Envelope(id_, payload, now, 0, now if sampled is None else sampled, stamp))


def that_hear(plan: Plan) -> list[str]:
    """The services that say where they hear the start; those of the deployment need not."""
    return [CLOCK] if plan.lockstep else [word for word in plan.world if "?=" not in word]


def hearers(plan: Plan, cid: int, addresses: Mapping[str, Address]) -> list[Address]:
    """Where to announce the start: to the services that take it, by the ``addresses`` that they said.

    Where one has not said any, or the application declares to take it, on the bus as well.
    """
    names = [CLOCK] if plan.lockstep else [service.name for service in plan.services]
    is_told = any(word.partition("/")[0] == TEST_BEGIN for word in plan.told)
    on_the_bus = is_told or any(name not in addresses for name in names)
    return [*(addresses[name] for name in names if name in addresses), *([group(cid)] if on_the_bus else [])]


def send_on_host(frame: bytes, to: Iterable[Address]) -> None:
    """Sends a datagram to addresses on this machine's own network; raises OSError."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for address in to:
            sender.sendto(frame, address)


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
            send_on_host(frame_of(kind(time=now), sampled=now, key=key), [group(cid)])
        except OSError as error:
            _log.warning("cannot send a sign of life to CID %d: %s", cid, error)
        await asyncio.sleep(ALIVE_S)
