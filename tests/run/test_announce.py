"""What the runner tells a session of this machine."""

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.plan.plan_json import from_json
from dodo_dsl.run.announce import signs_of_life
from dodo_dsl.run.docker.backend import DockerBackend
from dodo_dsl.run.protocol import BackendError

GOLDEN = Path(__file__).parents[1] / "compiler" / "golden" / "hil-dynamic" / "test.json"


def test_a_runner_gives_a_sign_of_life_each_second_and_none_afterwards(cid: int) -> None:
    async def live() -> None:
        async with signs_of_life(cid):
            await asyncio.sleep(1.5)

    with Session(cid) as session:
        asyncio.run(live())
        heard = []
        while (envelope := session.receive(1.5)) is not None:
            heard.append(envelope)
    assert [envelope.data_type for envelope in heard] == [session.messages.id("dodo.Alive")] * 2


def test_containers_on_the_host_that_cannot_be_told_to_begin_are_an_error(tmp_path: Path) -> None:
    plan = replace(from_json(GOLDEN.read_text()), cid=999)

    async def begin() -> None:
        client, pulls = None, None
        backend = DockerBackend(plan, tmp_path, tmp_path, client, pulls, "dodo-none", (), print)  # type: ignore[arg-type]
        await backend.begin()

    with pytest.raises(BackendError, match="the test's bus cannot be told that the test begins: "):
        asyncio.run(begin())
