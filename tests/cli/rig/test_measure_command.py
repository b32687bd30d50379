"""``dodo rig measure``: axes of a rig on a pseudo terminal that differs from the table, and a camera by its frames."""

import contextlib
import math
import re
import sys
from collections.abc import Callable, Iterator
from io import StringIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from dodo_dsl.cli import rig_measure
from dodo_dsl.cli.main import main
from dodo_dsl.run.rigs import access
from dodo_dsl.run.rigs.access import Command
from dodo_dsl.spec.deployment import load_deployment
from dodo_dsl.spec.manifest import load_manifests
from tests.calibration.board_pictures import pictures
from tests.run.rigs.place import Place, place
from tests.services.gantry.fake_rig import FakeRig

__all__ = ["place"]

RIGS = "dodo: 1\nrigs:\n  desk: {kind: static, cid: 120, camera: {source: rpicam, width: 640, height: 480}}  # mine\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    (tmp_path / "dodo.yml").write_text(RIGS)
    return tmp_path


def measure(*words: str, code: int) -> str:
    output = StringIO()
    assert main(["rig", "measure", *words], output, output) == code, output.getvalue()
    return output.getvalue()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["desk"], "rig 'desk' has no serial port, so it cannot move"),
        (["desk", "--places", "3"], "--places is 3, expected at least 4"),
        (["emulated"], "the emulated rig is as its firmware has it"),
        (["desk", "--axes", "x,z"], "there is no axis 'z', expected some of x, y, yaw"),
    ],
)
def test_what_cannot_be_measured(folder: Path, words: list[str], said: str) -> None:
    assert said in measure(*words, code=2)
    assert (folder / "dodo.yml").read_text() == RIGS


class Operator:
    """Reads off a protractor where the rig truly is: 1.02 times as far as it says, and 3 degrees on."""

    def __init__(self, rig: FakeRig, slip: Callable[[int], str | None]) -> None:
        self.rig, self.slip, self.count = rig, slip, 0

    def readline(self) -> str:
        self.count += 1
        if (said := self.slip(self.count)) is not None:
            return said
        return f"{1.02 * math.degrees(self.rig.at[2]) + 3:.4f} deg\n"


@pytest.mark.realtime
def test_an_axis_is_measured_in_a_dialogue(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    slips = {1: "\n", 3: "forty\n", 4: "40 mm\n", 5: "10 deg\n"}
    monkeypatch.setattr(sys, "stdin", Operator(place.rig, slips.get))
    place.rig.homes_slowly = False
    said = place.dodo("rig", "measure", "fake", "--axes", "yaw", "--places", "4", code=0)
    assert said.count("Its true position, such as") == 7, said
    assert "'forty' is not a quantity in deg" in said and "'40 mm' is a length, expected an angle in deg" in said
    assert re.search(r"yaw: reading 2, 10\.00 deg at .* steps, is \+\d+\.\d\d deg off .*; it is read again", said)
    rig = yaml.safe_load((place.folder / "dodo.yml").read_text())["rigs"]["fake"]
    steps, offset = (float(rig["axes"]["yaw"][name].split()[0]) for name in ("steps", "offset"))
    assert (steps, offset) == pytest.approx((0.55 / 1.02, 83 - 3 * 0.55 / 1.02), abs=1e-3)
    assert len(place.rig.commands("CALIBRATE")) == 1 and place.rig.last() == "STOP"
    place.dodo("rig", "goto", "fake", "0", "0", "105", code=0)
    assert math.degrees(place.rig.at[2]) == pytest.approx(100, abs=0.01)


@pytest.mark.realtime
def test_readings_that_cannot_be_the_rigs_change_nothing(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    class Careless(Operator):
        def readline(self) -> str:
            return f"{1.5 * math.degrees(self.rig.at[2]):.4f} deg\n"

    monkeypatch.setattr(sys, "stdin", Careless(place.rig, lambda _: None))
    before = (place.folder / "dodo.yml").read_text()
    said = place.dodo("rig", "measure", "fake", "--axes", "yaw", "--places", "4", code=1)
    assert "expected 0.495 to 0.605: are units, signs and the middle of the readings right?; nothing is written" in said
    assert (place.folder / "dodo.yml").read_text() == before


@pytest.mark.realtime
def test_others_wait_while_the_operator_reads_and_the_end_of_answers_ends_it(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    others = []

    class Slow(Operator):
        def readline(self) -> str:
            others.append(place.dodo("rig", "status", "fake", "--wait", "0", code=3))
            return ""

    monkeypatch.setattr(sys, "stdin", Slow(place.rig, lambda _: None))
    said = place.dodo("rig", "measure", "fake", code=2)
    assert "standard input ended, and nothing is written" in said
    assert "test 'dodo rig measure'" in others[0]
    assert not place.rig.received


@pytest.mark.thorough
def test_a_camera_is_measured_in_a_dialogue_and_written(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = [np.full((480, 640), 235, np.uint8), *pictures()]
    asked = []

    @contextlib.contextmanager
    def occupied(*_: object) -> Iterator[Callable[[Command], dict[str, Any]]]:
        def query(command: Command) -> dict[str, Any]:
            asked.append(command)
            output = next(word for word in command[1] if word.startswith("--output="))
            cv2.imwrite(output.removeprefix("--output="), shown[len(asked) - 1])
            return {"ok": True}

        yield query

    monkeypatch.setattr(rig_measure, "occupied", occupied)
    monkeypatch.setattr(rig_measure, "FRAMES", 9)
    monkeypatch.setattr(sys, "stdin", StringIO("\n" * 10))
    said = measure("desk", "--camera", code=0)
    assert "it shows fewer than 12 corners of the board: once more" in said and "focal-y: 52" in said
    assert len(asked) == 10 and "--source=rpicam" in asked[0][1] and "services.camera.snapshot" in asked[0][0]
    text = (folder / "dodo.yml").read_text()
    assert text.endswith("}}}  # mine\n")
    deployment, problems = load_deployment(folder / "dodo.yml")
    assert not problems and deployment.rigs["desk"].text("camera.intrinsics.fovy").startswith("48.")
    parameters = load_manifests(())[0]["projected-truth"].parameters
    given = {name: access._of_rig(deployment.rigs["desk"], about).value for name, about in parameters.items()}
    numbers = [float(value.text) for name in ("fovy", "distortion.k1", "distortion.p1") if (value := given[name])]
    assert numbers == [pytest.approx(48.887, abs=0.1), pytest.approx(-0.12, abs=0.01), pytest.approx(0.001, abs=0.01)]
