"""Any rig of a pool: the one that is free is taken, in turn; rigs that are not here or unfit are left out."""

import asyncio
import contextlib
import os
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from dodo_dsl.plan.model import Flag, PlannedService, Pooled
from dodo_dsl.run import leases
from dodo_dsl.run.backends import Job
from dodo_dsl.run.protocol import BackendError, Ready
from dodo_dsl.run.rigs.leases import leased, quarantine
from dodo_dsl.run.rigs.pool import opened
from dodo_dsl.run.runner import Runner
from dodo_dsl.run.schedule import Schedule
from dodo_dsl.run.sides import Backend
from tests.run.scripted import ScriptedBackend, drives, one_by_one, plan, run

DEVICES = {"kiwi-1": "/dev/null", "kiwi-2": "/dev/zero"}
CIDS = {"kiwi-1": 121, "kiwi-2": 122}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DODO_LEASES", str(tmp_path))
    monkeypatch.setenv("DODO_RIGS", str(tmp_path / "state"))
    return tmp_path


def on(rig: str, slug: str = "any") -> Job:
    pose = PlannedService("action", "pose", "mover", "x", (), (Flag("serial", DEVICES[rig]),))
    made = replace(plan(slug), rig=rig, cid=CIDS[rig], isolation="host", pool=Pooled(slug, slug))
    return Job(replace(made, services=(*made.services, pose)), Path(rig), Path("report"))


def pool(slug: str = "any") -> Job:
    return replace(on("kiwi-1", slug), others=(on("kiwi-2", slug),))


def backend(job: Job) -> AbstractAsyncContextManager[Backend]:
    """Holds the leases of a test's rig."""

    @contextlib.asynccontextmanager
    async def held() -> AsyncIterator[Backend]:
        async with leased(job.plan.cid, job.plan.slug, lambda _: None, devices=[DEVICES[job.plan.rig]]):
            yield cast(Any, None)

    return held()


Open = Callable[[Job], AbstractAsyncContextManager[Backend]]


async def drive(
    slug: str, seconds: float, said: list[str] | None = None, one: Job | None = None, held: Open = backend
) -> str:
    """The rig that a test took, after it had it for some time."""
    say = (said if said is not None else []).append
    async with opened(one or pool(slug), say, held) as (chosen, _):
        await asyncio.sleep(seconds)
        return chosen.plan.rig


def test_each_takes_another_rig_and_the_next_the_first_that_comes_free(folder: Path) -> None:
    said: list[str] = []

    async def scene() -> list[str]:
        return await asyncio.gather(*await one_by_one(drive("a", 30.0), drive("b", 10.0), drive("c", 1.0, said)))

    assert run(scene()) == ["kiwi-1", "kiwi-2", "kiwi-2"]
    assert said == [f"waiting for test a of process {os.getpid()}", "on rig 'kiwi-2'"]


def test_rigs_that_are_not_here_or_in_quarantine_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(DEVICES, "kiwi-1", "/dev/serial/by-id/elsewhere")
    assert run(drive("a", 0.0)) == "kiwi-2"
    quarantine("kiwi-2", "it lost its home", ["/dev/zero"])
    with pytest.raises(BackendError) as caught:
        run(drive("a", 0.0))
    assert str(caught.value) == (
        "no rig of the pool can be used here: kiwi-1: there is no '/dev/serial/by-id/elsewhere'; "
        "kiwi-2: in quarantine: it lost its home"
    )


def test_waiting_has_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(leases, "DEFAULT_PATIENCE_S", 60.0)

    async def scene() -> str:
        held = [asyncio.ensure_future(drive(slug, 500.0)) for slug in "ab"]
        await asyncio.sleep(0.1)
        with pytest.raises(BackendError) as caught:
            await drive("c", 1.0)
        await asyncio.gather(*held)
        return str(caught.value)

    said = run(scene())
    assert said.startswith("none of the rigs kiwi-1, kiwi-2 came free: no rig came free within 60 s; test a of process")


def test_the_outcome_names_the_rig() -> None:
    class Backends:
        name = "process"

        @contextlib.asynccontextmanager
        async def open(self, job: Job, _say: object, _keep: bool) -> AsyncIterator[Backend]:
            assert job.folder == Path("kiwi-2")
            yield ScriptedBackend(job.plan, {**drives(), "action": [(0.5, Ready("pose"))]})

    held = leases.try_lease("cid-121", {"test": "theirs"})
    assert held is not None
    quiet = SimpleNamespace(phase=lambda *_: None)
    runner = Runner(cast(Any, quiet), cast(Any, Backends()), Schedule(1))
    outcome = run(runner._attempt(pool()))
    held.release()
    assert (outcome.outcome, outcome.slug, outcome.notes) == ("passed", "any", ("ran on rig 'kiwi-2'",))
