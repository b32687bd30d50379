"""``dodo rig measure``: axes of a rig on a pseudo terminal that differs from the table."""

import math
import re
import sys
from collections.abc import Callable
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main
from dodo_dsl.cli.rig_measure import line
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
        (["desk", "--axes", "x,z"], "there is no axis 'z', expected some of x, y, yaw"),
    ],
)
def test_what_cannot_be_measured(folder: Path, words: list[str], said: str) -> None:
    assert said in measure(*words, code=2)
    assert (folder / "dodo.yml").read_text() == RIGS


class Operator:
    """Reads off a protractor where the rig truly is: ``scale`` times as far as it says, and 3 degrees on."""

    def __init__(self, rig: FakeRig, slip: Callable[[int], str | None], scale: float = 1.02) -> None:
        self.rig, self.slip, self.scale, self.count = rig, slip, scale, 0

    def readline(self) -> str:
        self.count += 1
        if (said := self.slip(self.count)) is not None:
            return said
        return f"{self.scale * math.degrees(self.rig.at[2]) + 3:.4f} deg\n"


@pytest.mark.realtime
def test_an_axis_is_measured_in_a_dialogue(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    slips = {1: "\n", 3: "forty\n", 4: "40 mm\n"}
    monkeypatch.setattr(sys, "stdin", Operator(place.rig, slips.get))
    place.rig.homes_slowly = False
    said = place.dodo("rig", "measure", "fake", "--axes", "yaw", code=0)
    assert said.count("Its true position, such as") == 7, said
    assert "'forty' is not a quantity in deg" in said and "'40 mm' is a length, expected an angle in deg" in said
    found = re.search(r"axes: \{yaw: \{steps: (\S+) steps/deg, offset: (\S+) steps\}\}", said)
    assert found and [*map(float, found.groups())] == pytest.approx((0.55 / 1.02, 83 - 3 * 0.55 / 1.02), abs=1e-3)
    assert len(place.rig.commands("CALIBRATE")) == 1 and place.rig.last() == "STOP"


@pytest.mark.realtime
@pytest.mark.parametrize(
    ("scale", "slip", "reason"),
    [
        (1.02, "10 deg\n", r"yaw: reading 2 is .* deg off the line of all, and 0\.5 deg are allowed"),
        (1.5, None, r"expected 0\.495 to 0\.605: are units, signs and the middle of the readings right\?"),
    ],
)
def test_readings_that_cannot_be_the_rigs(
    place: Place, monkeypatch: pytest.MonkeyPatch, scale: float, slip: str | None, reason: str
) -> None:
    monkeypatch.setattr(sys, "stdin", Operator(place.rig, {3: slip}.get, scale))
    said = place.dodo("rig", "measure", "fake", "--axes", "yaw", code=1)
    assert re.search(reason, said) and "dodo.yml" not in said


def test_a_circle_has_an_offset_only_and_a_heading_any_of_its_names() -> None:
    density, offset, residuals = line([0.0, 50.0, 100.0, 190.0], [175.5, -94.5, -4.5, 517.5], is_circle=True)
    assert (density, offset) == (pytest.approx(200 / 360), pytest.approx(102.5)) and max(abs(residuals)) < 1e-9


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
    assert "standard input ended before all was measured" in said
    assert "test 'dodo rig measure'" in others[0]
    assert not place.rig.received
