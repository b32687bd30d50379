"""Control groups of versions 1 and 2, by files that look like the kernel's."""

from pathlib import Path

import pytest

from dodo_dsl.run.machine_load import service_use
from dodo_dsl.run.machine_load.service_use import Used

OF_1 = "cache 999\nrss 5\nshmem 6\ntotal_cache 888\ntotal_rss 5000000\ntotal_rss_huge 0\ntotal_shmem 1000000\n"
OF_2 = "anon 5000000\nfile 777\nkernel_stack 1\nshmem 1000000\nfile_mapped 3\n"
CPU_2 = "usage_usec 2500000\nuser_usec 2000000\nsystem_usec 500000\nnr_periods 0\n"


class Machine:
    """Folders that look like ``/proc`` and ``/sys/fs/cgroup``; process 7 is in the group ``/docker/abc``."""

    def __init__(self, root: Path) -> None:
        self.proc, self.groups = root / "proc", root / "cgroup"
        (self.proc / "self").mkdir(parents=True)
        (self.proc / "7").mkdir()

    def mount(self, name: str, kind: str, options: str, root: str = "/") -> None:
        with (self.proc / "self" / "mountinfo").open("a") as file:
            file.write(f"30 25 0:26 {root} {self.groups / name} rw,relatime shared:4 - {kind} cgroup rw,{options}\n")

    def write(self, path: str, text: str) -> None:
        (self.groups / path).parent.mkdir(parents=True, exist_ok=True)
        (self.groups / path).write_text(text)

    def used(self, *groups: str) -> Used | None:
        (self.proc / "7" / "cgroup").write_text("".join(f"{line}\n" for line in groups))
        group = service_use.of_process(7, self.proc)
        return group.used() if group else None


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


EXPECTED = Used(pytest.approx(2.5), 6_000_000)


@pytest.mark.parametrize(("root", "below"), [("/", "docker/abc"), ("/docker", "abc"), ("/docker/abc", "")])
def test_version_1(machine: Machine, root: str, below: str) -> None:
    """Also where DoDo sees only a part of the groups, as in a container."""
    machine.mount("cpu,cpuacct", "cgroup", "cpu,cpuacct", root)
    machine.mount("memory", "cgroup", "memory", root)
    machine.mount("unified", "cgroup2", "nsdelegate", root)
    machine.write(f"memory/{below}/memory.stat", OF_1)
    machine.write(f"cpu,cpuacct/{below}/cpuacct.usage", "2500000000\n")
    groups = "4:memory:/docker/abc", "3:cpu,cpuacct:/docker/abc", "1:name=systemd:/docker/abc", "0::/"
    assert machine.used(*groups) == EXPECTED


def test_version_2(machine: Machine) -> None:
    machine.mount("", "cgroup2", "nsdelegate,memory_recursiveprot")
    machine.write("system.slice/docker-abc.scope/memory.stat", OF_2)
    machine.write("system.slice/docker-abc.scope/cpu.stat", CPU_2)
    assert machine.used("0::/system.slice/docker-abc.scope") == EXPECTED


def test_without_the_controller_of_memory_nothing_is_told(machine: Machine) -> None:
    machine.mount("", "cgroup2", "nsdelegate")
    machine.write("docker/abc/cpu.stat", CPU_2)
    assert machine.used("0::/docker/abc") is None
    assert machine.used("0::/elsewhere") is None
    assert service_use.of_process(8, machine.proc) is None


def test_a_group_that_is_gone(machine: Machine) -> None:
    machine.mount("", "cgroup2", "nsdelegate")
    machine.write("abc/memory.stat", OF_2)
    machine.write("abc/cpu.stat", CPU_2)
    (machine.proc / "7" / "cgroup").write_text("0::/abc\n")
    group = service_use.of_process(7, machine.proc)
    assert group is not None and group.used() == EXPECTED
    (machine.groups / "abc" / "memory.stat").unlink()
    assert group.used() is None


@pytest.mark.parametrize("stat", [OF_1, OF_2])
def test_what_an_engine_says(stat: str) -> None:
    stats = {
        "memory_stats": {"usage": 9, "stats": service_use.numbers(stat)},
        "cpu_stats": {"cpu_usage": {"total_usage": 2_500_000_000}},
    }
    assert service_use.of_engine(stats) == EXPECTED
    assert service_use.of_engine({**stats, "memory_stats": {}}) is None, "it has ended, or no controller of memory"
