"""What of the machine is used up, from trees of files as the kernel shows them."""

import os
import resource
from collections import namedtuple
from pathlib import Path

import pytest

from dodo_dsl.run.machine_load import shortage
from dodo_dsl.run.machine_load.shortage import Shared, Shortage
from dodo_dsl.spec.sandbox_limits import SandboxLimits

FREE = {
    "loadavg": "0.1 0.2 0.3 2/300 4711",
    "sys/kernel/pid_max": "32768",
    "sys/kernel/threads-max": "100000",
    "sys/fs/file-nr": "1000 0 200000",
    "sys/fs/aio-nr": "0",
    "sys/fs/aio-max-nr": "65536",
    "net/sockstat": "sockets: used 9\nUDP: inuse 6 mem 2",
    "sys/net/ipv4/udp_mem": "100 200 300",
    "sys/vm/overcommit_memory": "0",
    "meminfo": "MemTotal: 9 kB\nCommitLimit: 1024000 kB\nCommitted_AS: 1023000 kB",
    "sys/fs/inotify/max_user_instances": "10",
    "sys/fs/inotify/max_user_watches": "100",
    "sys/net/netfilter/nf_conntrack_count": "3",
    "sys/net/netfilter/nf_conntrack_max": "1000",
    "sysvipc/shm": "key\n1\n2\n3\n4",
    "sys/kernel/shmmni": "4096",
    "vmstat": "pgfault 3\noom_kill 7",
    "1/stat": "1 (init) S 0 1",
    "9/stat": "9 (a ) b) S 1 1",
    "17/stat": "17 (sl) S 9 1",
}
USED_UP = [
    ({"loadavg": "0 0 0 2/32766 5"}, "32,766 of 32,768 process numbers of this machine were in use, 3 of them by 'sl'"),
    ({"sys/kernel/threads-max": "302"}, "300 of 302 process numbers of this machine were in use, 3 of them by 'sl'"),
    ({"sys/fs/file-nr": "200000 0 200000"}, "200,000 of 200,000 open files of this machine were in use, 12 of them"),
    ({"sys/fs/aio-nr": "65536"}, "65,536 of 65,536 asynchronous requests (aio) were in use"),
    ({"net/sockstat": "UDP: inuse 6 mem 300"}, "300 of 300 pages of memory for UDP (udp_mem) were in use"),
    ({"sys/vm/overcommit_memory": "2"}, "999 of 1,000 MB of memory that programs may ask for (overcommit_memory)"),
    ({"sys/fs/inotify/max_user_instances": "6"}, "5 of 6 inotify instances of user 0 were in use, 5 of them by 'sl'"),
    ({"sys/net/netfilter/nf_conntrack_count": "999"}, "999 of 1,000 tracked connections (nf_conntrack_max)"),
    ({"sys/kernel/shmmni": "5"}, "4 of 5 System V identifiers (shm) were in use"),
    ({}, ""),
]
HOST = Shared(host=True, engine=True)


def tree(root: Path, changed: dict[str, str]) -> Path:
    """A file system with one process, which has three threads, twelve open files and five inotify instances."""
    for name, text in {**FREE, **changed}.items():
        path = root / "proc" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n")
    process = root / "proc/17"
    for name in ("task/17", "task/18", "task/19", "fdinfo", "fd"):
        (process / name).mkdir(parents=True, exist_ok=True)
    (process / "comm").write_text("sl\n")
    for number in range(12):
        (process / f"fd/{number}").symlink_to("anon_inode:inotify" if number < 5 else "/dev/null")
        (process / f"fdinfo/{number}").write_text("pos: 0\ninotify wd:1 ino:9\n")
    return root


@pytest.mark.parametrize(("changed", "sentence"), USED_UP)
def test_what_is_used_up_is_named_with_who_uses_it(tmp_path: Path, changed: dict[str, str], sentence: str) -> None:
    found = shortage.used_up(HOST, [4], tree(tmp_path, changed)).text.replace(f"user {os.getuid()}", "user 0")
    assert found.startswith(sentence)
    assert bool(found) == bool(sentence)


@pytest.mark.parametrize("changed", [{"sys/net/netfilter/nf_conntrack_count": "999"}, {"sys/kernel/shmmni": "5"}])
def test_what_a_test_does_not_share_may_be_used_up(tmp_path: Path, changed: dict[str, str]) -> None:
    assert not shortage.used_up(Shared(host=False, engine=False), [4], tree(tmp_path, changed)).text


def test_a_full_file_system_is_named_where_it_is_shared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "tmp").mkdir()
    found = namedtuple("found", "f_blocks f_bavail f_frsize f_files f_favail")(1000, 1, 4096, 10, 10)
    monkeypatch.setattr(os, "statvfs", lambda _: found)
    root = tree(tmp_path, {})
    assert shortage.used_up(Shared(host=True, engine=False), [4], root) == Shortage(
        f"the file system of {root}/tmp was full", is_of_others=False
    )
    assert not shortage.used_up(Shared(host=False, engine=False), [4], root).text


OF_USERS = {"sys/fs/inotify/max_user_instances": "6"}
OF_THREADS = {"sys/kernel/threads-max": "7", "loadavg": "0 0 0 1/7 5"}


@pytest.mark.parametrize(
    ("changed", "application", "is_of_others"),
    [
        (OF_USERS, [4], True),
        (OF_USERS, [], True),
        (OF_USERS, [17], False),
        (OF_USERS, [9], False),
        (OF_USERS, None, False),
        (OF_THREADS, [4], True),
        (OF_THREADS, [9], False),
        ({**OF_THREADS, **OF_USERS, "sys/kernel/threads-max": "12", "loadavg": "0 0 0 1/12 5"}, [4], True),
        ({"sys/fs/aio-nr": "65536"}, [4], False),
        ({"17/stat": "17 (sl) S 12 1", **OF_USERS}, [4], False),
    ],
)
def test_only_others_excuse_the_application(
    tmp_path: Path, changed: dict[str, str], application: list[int] | None, is_of_others: bool
) -> None:
    """The process is a child of 9; who is no descendant of a known one may be the application's."""
    found = shortage.used_up(HOST, application, tree(tmp_path, changed))
    assert found.text
    assert found.is_of_others == is_of_others
    assert "inotify" in found.text or changed is not OF_USERS


def test_a_descriptor_that_is_closed_meanwhile_hides_no_other(tmp_path: Path) -> None:
    root = tree(tmp_path, OF_USERS)
    (root / "proc/17/fd/20").touch()  # is no link any more
    assert shortage.used_up(HOST, [4], root).text.startswith("5 of 6 inotify instances")


def test_lower_limits_of_the_shell_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not shortage.below(SandboxLimits(files=1, file_size=1, memory=1))
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (9, 256 if kind == resource.RLIMIT_NOFILE else -1))
    sentence = "DoDo was started with at most 256 open files (ulimit -Hn), the test allows 1,024"
    assert shortage.below(SandboxLimits()) == sentence


def test_kills_for_want_of_memory_are_counted(tmp_path: Path) -> None:
    assert shortage.memory_kills(tree(tmp_path, {}) / "proc") == 7
    assert shortage.memory_kills(tmp_path / "nowhere") == 0
