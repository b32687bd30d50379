"""An application with the test's time (lockstep) attacks what gives it that time."""

import json
import os
import select
import sys
import time
from pathlib import Path

import pytest

from tests.services.clock.native.application import BEGIN, PATIENCE_S, SECOND, Application, compiled, refusal

HEAD = """
import mmap, os, struct, time
folder = os.environ["DODO_TIME"]
with open(f"{folder}/page", "r+b") as file:
    page = mmap.mmap(file.fileno(), 0)
def write(at, form, *values):
    struct.pack_into("<" + form, page, at, *values)
NOW, BASE, SEED, NOTES, PROCESSES, TEXTS, SLOTS = 16, 24, 32, 44, 48, 4096, 8192
time.sleep(10.5)
"""
TAIL = "\ntime.sleep(0.25)\nprint(round(time.time(), 3), round(time.monotonic(), 3), flush=True)\n"
HEADS = {
    "another time": "write(NOW, 'q', 1 << 62)",
    "an earlier time": "write(NOW, 'q', 0)",
    "another clock": "write(BASE, 'q', -1 << 62)",
    "no magic": "write(0, 'q', 0)",
}
TABLES = {
    "no processes": "write(PROCESSES, '64I', *[0] * 64)",
    "notes": "page[TEXTS:SLOTS] = bytes(range(256)) * 16; write(TEXTS, 'I', 1); write(NOTES, 'I', 0xfffffff0)",
    "who is due": "[write(SLOTS + 128 * n, 'IIqII', 2, n, -1 << 63, n % 7, ~n % 2**32) for n in range(2, 66)]",
    "who is in no state": "[write(SLOTS + 128 * n, 'I', 0xffffffff) for n in range(2, 1024)]",
}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    why = refusal()
    if why:
        pytest.skip(why)
    return compiled(tmp_path_factory.mktemp("native"))


def program(text: str) -> list[str | Path]:
    return [sys.executable, "-S", "-c", HEAD + text + TAIL]


@pytest.mark.parametrize("name", [*HEADS, *TABLES])
def test_what_it_writes_into_the_page_changes_no_time(built: Path, name: str) -> None:
    with Application(built, program({**HEADS, **TABLES}[name])) as application:
        reached = application.run(2)
        if not name.endswith("time"):  # by which it then waits itself, as long as it likes
            assert application.code() == 0
            assert application.output() == f"{BEGIN / SECOND + 0.75} 1010.75\n"
    assert (reached["now"], reached["services"]) == (BEGIN + 2 * SECOND, [0])
    kinds = [note["kind"] for note in reached["notes"]]
    assert ("page" in kinds) == (name in HEADS)
    assert len(kinds) <= 64


def test_a_page_destroyed_before_the_clock_listens_is_said(built: Path) -> None:
    with Application(built, program("")) as application:
        application._command.close()
        application._reply.close()
        os.truncate(application.folder / "page", 0)
        time.sleep(0.2)  # it may or may not have noticed
        reply = os.open(application.folder / "reply", os.O_RDONLY | os.O_NONBLOCK)
        try:
            assert select.select([reply], [], [], PATIENCE_S)[0]
            assert json.loads(os.read(reply, 4096)) == {"destroyed": True}
        finally:
            os.close(reply)
