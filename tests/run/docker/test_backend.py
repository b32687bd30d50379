"""What the backend makes of the ends of containers."""

import asyncio
import socket
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from docker.errors import APIError

from dodo_dsl.plan.model import Application, ApplicationService
from dodo_dsl.run.docker.compose import Compose
from dodo_dsl.run.docker.side import ContainerSide
from dodo_dsl.run.outcomes import unstartable
from dodo_dsl.run.protocol import Event, Exited, Noted, Ready
from dodo_dsl.run.sides import WatchedServices
from tests.run.scripted import plan

NOBODY: Any = None


def test_a_crash_upon_the_end_is_reported(tmp_path: Path) -> None:
    async def ends() -> list[Event]:
        watched = WatchedServices(plan("t"), tmp_path, tmp_path)
        side = ContainerSide(watched, NOBODY, NOBODY, NOBODY, [])
        side._is_closing = True
        for code in (0, 1, 134, 137, 139, 143):
            side._take(f"app{code}", "die", {"exitCode": str(code)})
        side._take("app", "oom", {})
        return [watched.events.get_nowait() for _ in range(watched.events.qsize())]

    assert asyncio.run(ends()) == [Exited("app134", 134), Exited("app139", 139), Exited("app143", 143)]


class Container:
    """One that starts after ``problems``, with a health check that the engine never asks."""

    def __init__(self, *problems: str, config: str = "Config") -> None:
        self.problems = [*problems]
        self.attrs: dict[str, Any] = {config: {"Healthcheck": {"Test": ["CMD", "false"]}}}

    def start(self) -> None:
        if self.problems:
            raise APIError("", None, self.problems.pop(0))

    def attach_socket(self, **_: object) -> Any:
        ours, theirs = socket.socketpair()
        theirs.close()
        return SimpleNamespace(_sock=ours, _response=ours)


def in_turn(folder: Path, *statuses: tuple[str, str], optional: tuple[str, ...] = (), **others: Container) -> Any:
    """What is awaited of an application, and what is reported, of one that waits for another one's health."""
    services = (ApplicationService("app", after={"db": "service_healthy"}, optional=optional), ApplicationService("db"))

    async def started() -> tuple[dict[str, bool], list[Event]]:
        watched = WatchedServices(plan("t", application=Application(".", services)), folder, folder)
        has_check = SimpleNamespace(has_healthcheck=lambda _: True, project="dodo-t", say=print)
        side = ContainerSide(watched, cast(Compose, has_check), NOBODY, NOBODY, [])
        side._containers = {"app": Container(), "db": Container(), **others}
        waits = await side.start("application")
        for name, status in statuses:
            side._take(name, f"health_status: {status}", {})
        await asyncio.wait(watched.turns)
        await asyncio.sleep(0)  # for what is called when they are done
        events = [await watched.events.get() for _ in range(watched.events.qsize())]
        await side.close(keep=True)
        watched.close()
        return waits, events

    return asyncio.run(asyncio.wait_for(started(), 20.0))


ILL = unstartable(plan(), "app", "its healthcheck failed: it is unhealthy")


@pytest.mark.parametrize(("status", "last"), [("healthy", [Ready("app")]), ("unhealthy", [ILL])])
def test_one_that_waits_for_others_has_its_own_health_awaited(status: str, last: list[Event], tmp_path: Path) -> None:
    waits, events = in_turn(tmp_path, ("db", "healthy"), ("app", status))
    assert (waits, events) == ({"app": True, "db": True}, [Ready("db"), *last])


def test_an_optional_service_need_not_be_healthy(tmp_path: Path) -> None:
    waits, events = in_turn(tmp_path, ("db", "unhealthy"), ("app", "healthy"), optional=("db",))
    assert waits == {"app": True, "db": False}
    assert [type(event) for event in events] == [Ready, Noted], events


SLOW, BAD = "failed to create shim task: io pipe: context deadline exceeded", "failed to create shim task: no such file"


@pytest.mark.parametrize("problems", [(SLOW,), (SLOW, SLOW), (BAD,)])
def test_what_a_busy_engine_does_not_start_is_started_once_more(problems: tuple[str, ...], tmp_path: Path) -> None:
    events = in_turn(tmp_path, ("db", "healthy"), ("app", "healthy"), app=Container(*problems))[1]
    notes = [Noted(f"the container of 'app' is started once more: {SLOW}")] * (problems[0] == SLOW)
    assert events[2:] == [*notes, *[unstartable(plan(), "app", problems[-1])] * (problems != (SLOW,))]
