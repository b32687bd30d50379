"""The processes of containers: found by the engine's answers, and only on the machine that runs them."""

from pathlib import Path
from typing import Any

import pytest
from docker.errors import APIError

from dodo_dsl.application.model import SANDBOX
from dodo_dsl.run.docker import container_use
from dodo_dsl.run.docker.container_use import ContainerUse
from dodo_dsl.run.machine_load.service_use import Used
from tests.run.load.test_service_use import Proc

NOBODY: Any = None


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
    for pid, group in ((10, "0::/../c0ffee"), (11, "0::/")):
        found.put(pid, 1, megabytes=3, threads={pid: (100, 10)})
        (tmp_path / str(pid) / "cgroup").write_text(f"{group}\n")
    return found


def test_which_containers_listen_on_a_bus(proc: Proc, monkeypatch: pytest.MonkeyPatch) -> None:
    """By their sockets; where those are hidden, by the members of their networks."""
    (proc.root / "10" / "net").mkdir()
    (proc.root / "10" / "net" / "igmp").write_text("Idx\tDevice\n2\teth0\n\t\t\t\t830000E1     1 0:00000000\t\t0\n")
    containers = ContainerUse({"app": Container("c0ffee", 10), "camera": Container("beef", 12)}, proc=proc.root)
    monkeypatch.setattr(container_use, "listening", lambda services, _: set(services.values()))
    assert containers.listeners(["app"], 130) == {"app"}
    assert containers.listeners(["camera"], 130) is None
    monkeypatch.setattr(container_use, "listening", lambda *_: None)
    assert (containers.listeners(["app"], 131), containers.listeners(["app"], 130)) == ({"app"}, set())


def test_the_first_processes_of_the_application(proc: Proc) -> None:
    """None where the engine runs one of them elsewhere, or does not tell."""
    containers = {"app": Container("c0ffee", 10), "ended": Container("beef", 0), "far": Container("beef", 11)}
    found = ContainerUse({**containers, "mute": Container("c0ffee", 10, APIError("no"))}, proc=proc.root)
    assert found.first(["app", "ended"]) == {10: "app"}
    assert (found.first(["app", "far"]), found.first(["mute"])) == (None, None)


def test_what_containers_used_by_their_processes(proc: Proc) -> None:
    app, sandbox, ended = Container("c0ffee", 10), Container("c0ffee", 11), Container("beef", 0)
    use = ContainerUse({"app": app, "ended": ended, SANDBOX: sandbox}, ["app"], proc.root)
    assert (taken := use.take()) is not None and taken.services == {"app": Used(0.0, 0.01, 3 << 20)}
    proc.end(10)
    assert (taken := use.take()) is not None and taken.services == {"app": Used(0.0, 0.01, 0)}


def test_the_load_is_measured_where_all_containers_run_here(proc: Proc) -> None:
    def is_measured(**containers: Container) -> bool:
        taken = ContainerUse(containers, ["app"], proc.root).take()
        return taken is not None and taken.busy_s is not None

    app = Container("c0ffee", 10)
    assert is_measured(app=app) and is_measured(app=app, ended=Container("beef", 0))
    assert not is_measured(app=app, camera=Container("beef", 12)), "or counts as others"
    assert not is_measured(app=Container("c0ffee", 12))
    assert not is_measured(app=Container("c0ffee", 10, APIError("gone")))
    assert not is_measured()
