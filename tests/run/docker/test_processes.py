"""The processes of containers: found by the engine's answers, and only on the machine that runs them."""

import asyncio
import contextlib
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from docker.errors import APIError

from dodo_dsl.application.model import SANDBOX
from dodo_dsl.run.docker import container_use
from dodo_dsl.run.docker.backend import DockerBackend
from dodo_dsl.run.docker.container_use import ContainerProcesses, ContainerUse
from dodo_dsl.run.docker.pulls import Pulls
from dodo_dsl.run.machine_load.snapshot import Times
from dodo_dsl.run.protocol import BackendError
from tests.run.helpers import Bench
from tests.run.load.test_thread_times import Proc


class Container:
    """A container as the engine's client shows it."""

    def __init__(self, number: str, pid: int, problem: Exception | None = None) -> None:
        self.id, self.problem = number, problem
        self.attrs: dict[str, Any] = {"State": {"Pid": pid}}

    def reload(self) -> None:
        if self.problem:
            raise self.problem


@pytest.fixture
def proc(tmp_path: Path) -> Proc:
    """Process 10 belongs to container c0ffee, 11 to no container."""
    found = Proc(tmp_path)
    (tmp_path / "stat").write_text("".join(f"cpu{core} 1 1 1 1 1 1 1 1 0 0\n" for core in range(1024)))
    for pid, group in ((10, "0::/../c0ffee"), (11, "0::/")):
        found.put(pid, 1, {pid: (100, 10)})
        (tmp_path / str(pid) / "cgroup").write_text(f"{group}\n")
    return found


def test_which_containers_listen_on_a_bus(proc: Proc, monkeypatch: pytest.MonkeyPatch) -> None:
    """By their sockets; where those are hidden, by the members of their networks."""
    (proc.root / "10" / "net").mkdir()
    (proc.root / "10" / "net" / "igmp").write_text("Idx\tDevice\n2\teth0\n\t\t\t\t830000E1     1 0:00000000\t\t0\n")
    containers = ContainerProcesses({"app": Container("c0ffee", 10), "camera": Container("beef", 12)}, proc.root)
    monkeypatch.setattr(container_use, "listening", lambda services, _: set(services.values()))
    assert containers.listeners(["app"], 130) == {"app"}
    assert containers.listeners(["camera"], 130) is None
    monkeypatch.setattr(container_use, "listening", lambda *_: None)
    assert (containers.listeners(["app"], 131), containers.listeners(["app"], 130)) == ({"app"}, set())


def test_the_first_processes_of_the_application(proc: Proc) -> None:
    """None where the engine runs one of them elsewhere, or does not tell."""
    containers = {"app": Container("c0ffee", 10), "ended": Container("beef", 0), "far": Container("beef", 11)}
    found = ContainerProcesses({**containers, "mute": Container("c0ffee", 10, APIError("no"))}, proc.root)
    assert found.first(["app", "ended"]) == {10: "app"}
    assert (found.first(["app", "far"]), found.first(["mute"])) == (None, None)


@pytest.mark.parametrize(("isolation", "pids"), [("host", [10]), ("host", [11]), ("network", [11]), ("host", [11, 0])])
@pytest.mark.thorough
def test_a_test_on_the_network_of_another_host_does_not_begin(
    isolation: str, pids: list[int], proc: Proc, tmp_path: Path
) -> None:
    """In the engine's own network of a test it does, and so it does where a service ends meanwhile."""

    class Changing(Container):
        def reload(self) -> None:
            self.attrs = {"State": {"Pid": pids.pop(0) if len(pids) > 1 else pids[0]}}

    async def begin() -> None:
        plan = replace(Bench(tmp_path).plan(), isolation=isolation)
        backend = DockerBackend(plan, tmp_path, tmp_path, None, Pulls(None), "p", (), print, b"")
        backend._processes = ContainerProcesses({"app": Changing("c0ffee", 0)}, proc.root)
        await backend.require_own_host()

    refused = pytest.raises(BackendError, match=r"another machine.*use --isolation network")
    with refused if (isolation, pids) == ("host", [11]) else contextlib.nullcontext():
        asyncio.run(begin())


def test_one_thread_at_a_time_measures(proc: Proc) -> None:
    """Another may have been given up, and still be at it."""
    both, met = threading.Barrier(2), []

    class Slow(Container):
        def reload(self) -> None:
            with contextlib.suppress(threading.BrokenBarrierError):
                met.append(both.wait(0.1))

    use = ContainerUse({"app": Slow("c0ffee", 0)}, proc.root)
    threads = [threading.Thread(target=use.take) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not met


def services(proc: Proc, **containers: Any) -> dict[str, Times] | None:
    found = ContainerProcesses(containers, proc.root).load()
    return None if found is None else dict(found.services)


def test_what_containers_on_this_machine_used(proc: Proc) -> None:
    used = {"app": Times(pytest.approx(0.1), pytest.approx(0.01))}
    assert services(proc, app=Container("c0ffee", 10), **{SANDBOX: Container("c0ffee", 11)}) == used
    assert services(proc, app=Container("c0ffee", 10), ended=Container("beef", 0)) == used


def test_containers_on_another_machine_are_not_measured(proc: Proc) -> None:
    """A process here may have the number of one there."""
    assert services(proc, app=Container("c0ffee", 11)) is None
    assert services(proc, app=Container("c0ffee", 12)) is None
    assert services(proc, app=Container("c0ffee", 10), camera=Container("beef", 12)) is None, "or counts as others"
    assert services(proc, app=Container("c0ffee", 10, APIError("gone"))) is None
    assert services(proc) is None
