"""``dodo rig measure`` of the emulated firmware with wrong constants: the dialogue, and where the rig goes then."""

import math
import re
import signal
import sys
import threading
import time
from collections.abc import Iterator
from io import StringIO
from pathlib import Path

import pytest
import yaml

from dodo_dsl.cli.main import main
from services.gantry.rig_table import MICROSTEP, OFFSETS, STEPS
from tests.firmware.programs import ROOT, Rig

SCALE, SHIFT = {"x": 1.03, "y": 0.97, "yaw": 1.01}, {"x": 0.007, "y": -0.005, "yaw": 2.0}
STEP, HEARD = 0.01, 0.3
"""s of the rig: a step, and how long after its last answer its time passes as fast as it can: no watchdog barks."""


class Running:
    """A rig whose time passes, faster than in reality as long as somebody asks it."""

    def __init__(self, rig: Rig) -> None:
        self.rig, self._lock, self._ended = rig, threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> "Running":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        heard, sent = 0.0, 0
        while not self._ended.is_set():
            with self._lock:
                self.rig.run(STEP)
            heard, sent = (0.0, self.rig.sent) if self.rig.sent != sent else (heard + STEP, sent)
            if heard > HEARD:
                time.sleep(2 * STEP)

    def pose(self) -> dict[str, float]:
        """Where it truly is (m, m, degrees)."""
        with self._lock:
            pose = self.rig.pose()
        return {"x": pose["x"], "y": pose["y"], "yaw": math.degrees(pose["yaw"])}


class Operator:
    """Answers each question with the true place of the axis that it names."""

    def __init__(self, rig: Running, asked: StringIO) -> None:
        self.rig, self.asked = rig, asked

    def readline(self) -> str:
        names = re.findall(r"(\w+): the rig stands", self.asked.getvalue())
        unit = "deg" if names and names[-1] == "yaw" else "m"
        return f"{self.rig.pose()[names[-1]]:.9f} {unit}\n" if names else "\n"


@pytest.fixture
def crooked(firmware: None, tmp_path: Path, cid: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Running]:
    """A rig that differs from the firmware's constants, as ``crooked`` of the dodo.yml of this folder."""
    monkeypatch.chdir(tmp_path)
    variables = {"PYTHONPATH": ROOT, "DODO_RIGS": tmp_path / "state", "DODO_LEASES": tmp_path / "leases"}
    for name, value in variables.items():
        monkeypatch.setenv(name, str(value))
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    scale, shift = (",".join(map(str, one.values())) for one in (SCALE, SHIFT))
    with Rig("--scale", scale, "--shift", shift) as rig, Running(rig) as running:
        entry = {"kind": "dynamic", "cid": cid, "serial": rig.path}
        (tmp_path / "dodo.yml").write_text(yaml.safe_dump({"dodo": 1, "rigs": {"crooked": entry}}))
        yield running
    for number, handler in before.items():
        signal.signal(number, handler)


def dodo(*words: str, said: StringIO) -> None:
    assert main(["rig", *words], said, said) == 0, said.getvalue()


@pytest.mark.realtime
def test_a_rig_with_other_constants_is_measured_and_then_goes_where_it_is_told(
    crooked: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Readings that are exact are enough for a microstep."""
    said = StringIO()
    monkeypatch.setattr(sys, "stdin", Operator(crooked, said))
    dodo("measure", "crooked", said=said)
    assert said.getvalue().count("Its true position, such as") == 15
    axes = yaml.safe_load(next(row for row in said.getvalue().splitlines() if row.startswith("  axes:")))["axes"]
    deployment = yaml.safe_load(Path("dodo.yml").read_text())
    deployment["rigs"]["crooked"]["axes"] = axes
    Path("dodo.yml").write_text(yaml.safe_dump(deployment))
    for name, written in axes.items():
        steps, offset = (float(written[what].split()[0]) for what in ("steps", "offset"))
        assert steps == pytest.approx(STEPS[name] / SCALE[name], rel=3e-5)
        assert offset == pytest.approx(OFFSETS[name] - SHIFT[name] * steps, abs=0.01)
    for place in ({"x": 0.9, "y": 0.6, "yaw": 166.0}, {"x": -0.9, "y": -0.65, "yaw": -143.0}):
        dodo("goto", "crooked", *map(str, place.values()), said=said)
        off = {name: abs(found - place[name]) for name, found in crooked.pose().items()}
        microsteps = {**MICROSTEP, "yaw": math.degrees(MICROSTEP["yaw"])}
        assert all(off[name] <= microsteps[name] * SCALE[name] + 1e-6 for name in axes), off
        assert off["yaw"] < 0.1
