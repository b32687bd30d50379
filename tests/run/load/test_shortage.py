"""What of the machine is used up, from trees of files as the kernel shows them."""

import os
from pathlib import Path

import pytest

from dodo_dsl.run.machine_load import shortage
from dodo_dsl.run.machine_load.shortage import Shortage

FREE = {
    "loadavg": "0.1 0.2 0.3 2/300 4711",
    "sys/kernel/pid_max": "32768",
    "sys/kernel/threads-max": "100000",
    "vmstat": "pgfault 3\noom_kill 7",
    "1/stat": f"1 (init) S 0 1{' 0' * 20}",
    "9/stat": f"9 (a ) b) S 1 1{' 0' * 20}",
    "17/stat": f"17 (sl) S 9 1{' 0' * 20}",
}
OF_FEW = {"loadavg": "0 0 0 2/32766 5"}
OF_THREADS = {"sys/kernel/threads-max": "7", "loadavg": "0 0 0 1/7 5"}
OF_GROUP = {
    "self/cgroup": "0::/a",
    "self/mountinfo": "30 25 0:26 / {proc}/groups rw - cgroup2 cgroup rw",
    "groups/a/cgroup.procs": "",
    "groups/a/b/cgroup.procs": "17",
    "groups/a/pids.current": "3",
    "groups/a/pids.max": "5",
}


def tree(proc: Path, changed: dict[str, str]) -> Path:
    """Three processes; the last has three threads."""
    for name, text in {**FREE, **changed}.items():
        path = proc / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n".replace("{proc}", str(proc)))
    for name in ("task/17", "task/18", "task/19"):
        (proc / "17" / name).mkdir(parents=True, exist_ok=True)
    return proc


@pytest.mark.parametrize(
    ("changed", "application", "sentence", "is_of_others"),
    [
        ({}, [4], "", False),
        (OF_FEW, [4], "32,766 of 32,768 process numbers of this machine were in use", False),
        (OF_THREADS, [4], "7 of 7 process numbers of this machine were in use", True),
        (OF_THREADS, [9], "7 of 7 process numbers of this machine were in use", False),
        (OF_GROUP, [4], "3 of 5 processes of the control group {proc}/groups/a were in use", True),
        (OF_GROUP, [17], "3 of 5 processes of the control group {proc}/groups/a were in use", False),
        (OF_GROUP, None, "3 of 5 processes of the control group {proc}/groups/a were in use", False),
        ({**OF_GROUP, **OF_FEW}, [4], "3 of 5 processes of the control group {proc}/groups/a were in use", True),
        ({"17/stat": FREE["17/stat"].replace("S 9", "S 12"), **OF_GROUP}, [4], "3 of 5 processes", False),
    ],
)
def test_only_others_excuse_the_application(
    tmp_path: Path, changed: dict[str, str], application: list[int] | None, sentence: str, is_of_others: bool
) -> None:
    """The process is a child of 9; who is no descendant of a known one may be the application's."""
    found = shortage.used_up(application, tree(tmp_path, changed))
    assert found.text.startswith(sentence.format(proc=tmp_path))
    assert (bool(found.text), found.is_of_others) == (bool(sentence), is_of_others)


@pytest.mark.parametrize(("user", "application", "text"), [(9, [4], True), (9, [17], True), (0, [4], False)])
def test_processes_of_a_user_are_limited_but_of_root(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, user: int, application: list[int], text: bool
) -> None:
    monkeypatch.setattr(shortage.resource, "getrlimit", lambda _: (9, 3))
    monkeypatch.setattr(os, "getuid", lambda: user)
    monkeypatch.setattr(shortage, "_is_of", lambda user, process: (user, process.name) == (9, "17"))
    found = shortage.used_up(application, tree(tmp_path, {}))
    assert found == Shortage("3 of 3 processes of user 9 were in use" * text, text and application == [4])


def test_kills_for_want_of_memory_are_counted(tmp_path: Path) -> None:
    assert shortage.memory_kills(tree(tmp_path, {})) == 7
    assert shortage.memory_kills(tmp_path / "nowhere") == 0
