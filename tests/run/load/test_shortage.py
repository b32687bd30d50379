"""What of the machine is used up, from trees of files as the kernel shows them."""

import os
from pathlib import Path

import pytest

from dodo_dsl.run.machine_load import shortage

FREE = {
    "loadavg": "0.1 0.2 0.3 2/300 4711",
    "sys/kernel/pid_max": "32768",
    "sys/kernel/threads-max": "100000",
    "sys/fs/inotify/max_user_instances": "10",
    "sys/fs/inotify/max_user_watches": "100",
    "vmstat": "pgfault 3\noom_kill 7",
    "1/stat": f"1 (init) S 0 1{' 0' * 20}",
    "9/stat": f"9 (a ) b) S 1 1{' 0' * 20}",
    "17/stat": f"17 (sl) S 9 1{' 0' * 20}",
}
OF_USERS = {"sys/fs/inotify/max_user_instances": "6"}
OF_WATCHES = {"sys/fs/inotify/max_user_watches": "5"}
OF_THREADS = {"sys/kernel/threads-max": "7", "loadavg": "0 0 0 1/7 5"}
OF_BOTH = {**OF_USERS, "sys/kernel/threads-max": "12", "loadavg": "0 0 0 1/12 5"}
OF_GROUP = {
    "self/cgroup": "0::/a",
    "self/mountinfo": "30 25 0:26 / {proc}/groups rw - cgroup2 cgroup rw",
    "groups/a/cgroup.procs": "",
    "groups/a/b/cgroup.procs": "17",
    "groups/a/pids.current": "3",
    "groups/a/pids.max": "5",
}


def tree(proc: Path, changed: dict[str, str]) -> Path:
    """Three processes; the last has three threads, and five inotify instances with a watch each."""
    for name, text in {**FREE, **changed}.items():
        path = proc / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n".replace("{proc}", str(proc)))
    process = proc / "17"
    for name in ("task/17", "task/18", "task/19", "fdinfo", "fd"):
        (process / name).mkdir(parents=True, exist_ok=True)
    for number in range(12):
        (process / f"fd/{number}").symlink_to("anon_inode:inotify" if number < 5 else "/dev/null")
        (process / f"fdinfo/{number}").write_text("pos: 0\ninotify wd:1 ino:9\n")
    (process / "fd/20").touch()  # was closed meanwhile, and is no link any more
    return proc


@pytest.mark.parametrize(
    ("changed", "application", "sentence", "is_of_others"),
    [
        ({}, [4], "", False),
        ({"loadavg": "0 0 0 2/32766 5"}, [4], "32,766 of 32,768 process numbers of this machine were in use", False),
        (OF_THREADS, [4], "7 of 7 process numbers of this machine were in use", True),
        (OF_THREADS, [9], "7 of 7 process numbers of this machine were in use", False),
        (OF_GROUP, [4], "3 of 5 processes of the control group {proc}/groups/a were in use", True),
        (OF_GROUP, [17], "3 of 5 processes of the control group {proc}/groups/a were in use", False),
        (OF_WATCHES, [4], "5 of 5 inotify watches of user {user} were in use", True),
        (OF_USERS, [4], "5 of 6 inotify instances of user {user} were in use", True),
        (OF_USERS, [], "5 of 6 inotify instances of user {user} were in use", True),
        (OF_USERS, [17], "5 of 6 inotify instances of user {user} were in use", False),
        (OF_USERS, [9], "5 of 6 inotify instances of user {user} were in use", False),
        (OF_USERS, None, "5 of 6 inotify instances of user {user} were in use", False),
        (OF_BOTH, [4], "5 of 6 inotify instances of user {user} were in use", True),
        ({"17/stat": FREE["17/stat"].replace("S 9", "S 12"), **OF_USERS}, [4], "5 of 6 inotify", False),
    ],
)
def test_only_others_excuse_the_application(
    tmp_path: Path, changed: dict[str, str], application: list[int] | None, sentence: str, is_of_others: bool
) -> None:
    """The process is a child of 9; who is no descendant of a known one may be the application's."""
    found = shortage.used_up(application, tree(tmp_path, changed))
    assert found.text.startswith(sentence.format(proc=tmp_path, user=os.getuid()))
    assert (bool(found.text), found.is_of_others) == (bool(sentence), is_of_others)


def test_kills_for_want_of_memory_are_counted(tmp_path: Path) -> None:
    assert shortage.memory_kills(tree(tmp_path, {})) == 7
    assert shortage.memory_kills(tmp_path / "nowhere") == 0
