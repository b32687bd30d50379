"""How busy the machine was, and snapshots on their way from a sandbox."""

import json
import os
from dataclasses import asdict
from pathlib import Path

import msgspec

from dodo_dsl.run.machine_load import snapshot
from dodo_dsl.run.machine_load.processes import ThreadTimes
from dodo_dsl.run.machine_load.snapshot import Snapshot, Times, busy_s

STAT = """cpu  9 9 9 9 9 9 9 9 9 9
cpu0 100 20 300 9999 9999 4 5 60 8888 7777
cpu1 1 1 1 9999 9999 1 1 1 0 0
cpu10 7 7 7 7 7 7 7 7 7 7
intr 5
"""
TICK = 1 / os.sysconf("SC_CLK_TCK")


def test_cores_are_busy_with_whatever_keeps_others_off() -> None:
    """Neither idle nor waiting for disks; guests are in the user's time already."""
    assert busy_s(STAT, [0]) == 489 * TICK
    assert busy_s(STAT, [0, 1]) == 495 * TICK
    assert busy_s(STAT, [0, 2]) is None
    assert busy_s("cpu0 1 2 3 4", [0]) is None
    assert busy_s("", []) == 0


def test_a_machine_that_tells_nothing(tmp_path: Path) -> None:
    assert snapshot.take(ThreadTimes(tmp_path), {}, tmp_path) is None
    (tmp_path / "stat").write_text("")
    assert snapshot.take(ThreadTimes(tmp_path), {}, tmp_path) is None


def test_snapshots_are_the_same_behind_json() -> None:
    taken = Snapshot(1.5, 2, 3.5, {"app": Times(0.5, 0.25)})
    assert msgspec.convert(json.loads(json.dumps(asdict(taken))), Snapshot) == taken
