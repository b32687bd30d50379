"""What the runner sends to a session of this machine, and where it announces the begin of a test."""

import asyncio
from dataclasses import replace

import pytest

from dodo_dsl.opendlv.address import group
from dodo_dsl.opendlv.session import Session
from dodo_dsl.plan.model import Lockstep
from dodo_dsl.run.announce import hearers, heartbeat, that_hear
from tests.run.scripted import plan

CAMERA, TRACK, CLOCK = ("10.1.0.2", 40000), ("10.1.0.3", 40001), ("10.1.0.4", 40002)


def test_the_begin_goes_to_services_alone() -> None:
    test = replace(plan(), world=("camera", "track"))
    assert that_hear(test) == ["camera", "track"]
    assert hearers(test, 140, {"camera": CAMERA, "track": TRACK}) == [CAMERA, TRACK]
    stepped = replace(test, lockstep=Lockstep(1, 60.0))
    assert that_hear(stepped) == ["dodo-clock"]
    assert hearers(stepped, 140, {"dodo-clock": CLOCK, "camera": CAMERA}) == [CLOCK]


def test_it_comes_to_the_bus_for_who_does_not_say_its_address_and_for_who_is_told() -> None:
    own = replace(plan(), world=("camera", "track?=opendlv.sim.Frame/0"))
    assert that_hear(own) == ["camera"]
    assert hearers(own, 140, {"camera": CAMERA}) == [CAMERA, group(140)]
    told = replace(plan(), world=("camera", "track"), told=("dodo.TestBegin",))
    assert hearers(told, 140, {"camera": CAMERA, "track": TRACK}) == [CAMERA, TRACK, group(140)]


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
