"""A deployment with a rig on a pseudo terminal as the hardware."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl.cli.main import main
from services.gantry.rig_table import LIMITS
from tests.drive.applications import KIWI, ROOT, results
from tests.drive.variants import registry, variant
from tests.services.gantry.fake_rig import FakeRig

APPLICATION = ("--application", str(KIWI / "docker-compose.yml"))
CAMERA = {"map-path": "../maps/rig-straight", "z": "9.5 cm", "freq": "10 Hz"}
KEYS = {
    "rig": "fake",
    "environment": {"camera": {"uses": "virtual-camera", "with": CAMERA}},
    "action": {"pose": {"with": {"truth-id": None}}},
}


class Place:
    """A folder with a dodo.yml that has the rig, and its state; commands run in it."""

    def __init__(self, folder: Path, cid: int, rig: FakeRig) -> None:
        self.folder, self.rig = folder, rig
        rig.memory, rig.source = [1.0 if name == "y" else widest for name, (_, widest) in LIMITS.items()], 1
        self._started: list[subprocess.Popen[bytes]] = []
        variant(registry(folder), "hil-dynamic", "hil-fake", **KEYS)
        fake = {"kind": "dynamic", "cid": cid, "serial": str(rig.path), "limits": {"y": "1 m"}}
        deployment = {"dodo": 1, "registry": ["tests"], "rigs": {"fake": fake}}
        (folder / "dodo.yml").write_text(yaml.safe_dump(deployment))

    def dodo(self, *words: str, code: int) -> str:
        """What a command prints that runs in this process."""
        stdout = StringIO()
        found = main(words, stdout, stdout)
        assert (found, "Traceback" in stdout.getvalue()) == (code, False), stdout.getvalue()
        return stdout.getvalue()

    def start(self, *words: str, folder: Path | None = None) -> "subprocess.Popen[bytes]":
        """A command as a process of its own."""
        command = [sys.executable, "-m", "dodo_dsl", *words]
        self._started.append(subprocess.Popen(command, cwd=folder or self.folder, stdout=subprocess.DEVNULL))
        return self._started[-1]

    def close(self) -> None:
        """Ends what was started and still runs."""
        for process in self._started:
            process.kill()
            process.wait()

    def test(self, code: int) -> dict[str, Any]:
        """The result of the test on the rig."""
        self.dodo("run", "hil-fake", *APPLICATION, "--backend", "process", code=code)
        (test,) = results(self.folder / "dodo-report").values()
        return test


@contextlib.contextmanager
def ahead_of_others() -> Iterator[None]:
    """This process, and what it starts, goes ahead of others where this user may have it so: a rig does not wait."""
    before = os.getpriority(os.PRIO_PROCESS, 0)
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, -15)
    yield
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, before)


@pytest.fixture
def place(tmp_path: Path, cid: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Place]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("DODO_RIGS", str(tmp_path / "state"))
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    with ahead_of_others(), FakeRig(tmp_path / "port") as rig:
        rig.at, rig.homes_slowly = [-0.88, -0.68, -2.6], True
        found = Place(tmp_path, cid, rig)
        yield found
        found.close()
    for number, handler in before.items():
        signal.signal(number, handler)


@contextlib.contextmanager
def busy(place: Place, *words: str, folder: Path | None = None) -> Iterator["subprocess.Popen[bytes]"]:
    """A command that moves the rig for ever."""
    place.rig.status = 2
    process = place.start(*words, folder=folder)
    try:
        while not place.rig.commands("GOTO"):
            assert process.poll() is None
            time.sleep(0.02)
        yield process
    finally:
        process.terminate()
        assert process.wait(20) == 130
