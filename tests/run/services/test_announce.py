"""What the runner sends to a session of this machine."""

import asyncio

import pytest

from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.run.services.announce import heartbeat


@pytest.mark.slow
def test_a_runner_gives_a_sign_of_life_each_second_and_none_afterwards(cid: int) -> None:
    async def live() -> None:
        async with heartbeat(cid):
            await asyncio.sleep(1.5)

    with Session(cid) as session:
        asyncio.run(live())
        heard = []
        while (envelope := session.receive(1.5)) is not None:
            heard.append(envelope)
    assert [envelope.data_type for envelope in heard] == [session.messages.id("dodo.Alive")] * 2
