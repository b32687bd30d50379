"""``dodo rig measure``: with given readings, and with a rig on a pseudo terminal that differs from the table."""

import json
import math
import re
import sys
from collections.abc import Callable
from io import StringIO
from pathlib import Path

import pytest
import yaml

from dodo_dsl.cli.main import main
from tests.run.rigs.place import Place, place
from tests.services.gantry.fake_rig import FakeRig

__all__ = ["place"]

RIGS = "dodo: 1\nrigs:\n  desk: {kind: dynamic, cid: 120}  # mine\n"
EXACT = [f"--reading=x:{3223.3 * p / 1000 + 2965.4}:{p}mm" for p in (-700, -300, 300, 700)]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dodo.yml").write_text(RIGS)
    return tmp_path


def measure(*words: str, code: int) -> str:
    output = StringIO()
    assert main(["rig", "measure", *words], output, output) == code, output.getvalue()
    return output.getvalue()


def test_readings_of_flags_are_written(folder: Path) -> None:
    said = measure("desk", *EXACT, code=0)
    assert "desk: x: 3223.3000 ± " in said and "offset 2965.4000 ± " in said and said.count("residual") == 4
    assert f"written into {folder / 'dodo.yml'}; 'dodo rig calibrate desk' gives the rig its limits by" in said
    text = (folder / "dodo.yml").read_text()
    assert "    axes: {x: {steps: 3223.3000 steps/m, offset: 2965.4000 steps}}}  # mine\n" in text
    assert "compiled" not in text and main(["rig", "status", "desk"], StringIO(), StringIO()) == 0


def test_a_circle_has_only_the_offset_of_its_yaw_measured(folder: Path) -> None:
    (folder / "dodo.yml").write_text(RIGS.replace("dynamic", "circle"))
    # the heading backward has two names
    readings = [f"--reading=yaw:{s}:{p}deg" for s, p in ((0.0, 175.5), (50.0, -94.5), (100.0, -4.5), (190.0, 517.5))]
    said = measure("desk", *readings, code=0)
    assert "yaw: 0.5555556 ± 0 steps/deg, offset 102.5000 ± " in said
    rig = yaml.safe_load((folder / "dodo.yml").read_text())["rigs"]["desk"]
    assert rig["axes"] == {"yaw": {"offset": "102.5000 steps"}}
    assert main(["rig", "status", "desk"], StringIO(), StringIO()) == 0


def test_a_dry_run_writes_nothing_and_json_says_all(folder: Path) -> None:
    result = json.loads(measure("desk", *EXACT, "--dry-run", "--json", code=0))
    assert (result["rig"], result["written"], result["axes"]["x"]["unit"]) == ("desk", "", "steps/m")
    assert result["axes"]["x"]["steps"] == pytest.approx(3223.3) and len(result["axes"]["x"]["readings"]) == 4
    assert (folder / "dodo.yml").read_text() == RIGS


def test_a_file_of_which_one_reading_is_off_is_refused_with_its_place(folder: Path) -> None:
    rows = [{"steps": f"{0.55 * p + 83} steps", "reads": f"{p} deg"} for p in (-100, -50, 0, 50, 100)]
    rows[1]["reads"] = "-52 deg"
    (folder / "r.yml").write_text(yaml.safe_dump({"yaw": rows}))
    said = measure("desk", "--readings", "r.yml", code=1)
    assert (
        "yaw: reading 2, -52.00 deg at 55.50 steps, is -2.00 deg off the line of the others, and 0.50 deg are" in said
    )
    assert "nothing is written; the readings:\nyaw:\n  - {steps: 28.0000 steps, reads: -100.0000 deg}\n" in said
    assert (folder / "dodo.yml").read_text() == RIGS


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["desk"], 2, "rig 'desk' has no serial port, so it cannot move"),
        (["desk", "--places", "3"], 2, "--places is 3, expected at least 4"),
        (["emulated"], 2, "the emulated rig is as its firmware has it"),
        (["desk", "--axes", "x,z"], 2, "there is no axis 'z', expected some of x, y, yaw"),
        (["desk", "--reading", "x:1"], 2, "'x:1' is not a reading, expected AXIS:STEPS:PLACE"),
        (["desk", "--readings", "none.yml"], 2, "none.yml:1: cannot read the file"),
        (["desk", *EXACT, "--axes", "x,y"], 1, "y has 0 readings, expected at least 4"),
        (["desk", *EXACT[:1]], 1, "x has 1 reading, expected at least 4"),
        (["desk", *(word.replace("mm", "cm") for word in EXACT)], 1, "expected 2988 to 3652: are units, signs and"),
    ],
)
def test_what_cannot_be_measured(folder: Path, words: list[str], code: int, said: str) -> None:
    assert said in measure(*words, code=code)
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
    assert said.count("Its true place, such as") == 7, said
    assert "'forty' is not a quantity in deg" in said and "'40 mm' is a length, expected an angle in deg" in said
    assert re.search(r"yaw: reading 2, 10\.00 deg at .* steps, is \+\d+\.\d\d deg off .*; it is read again", said)
    rig = yaml.safe_load((place.folder / "dodo.yml").read_text())["rigs"]["fake"]
    steps, offset = (float(rig["axes"]["yaw"][name].split()[0]) for name in ("steps", "offset"))
    assert (steps, offset) == pytest.approx((0.55 / 1.02, 83 - 3 * 0.55 / 1.02), abs=1e-3)
    assert len(place.rig.commands("CALIBRATE")) == 1 and place.rig.last() == "STOP"
    place.dodo("rig", "goto", "fake", "0", "0", "105", code=0)
    assert math.degrees(place.rig.at[2]) == pytest.approx(100, abs=0.01)


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
    assert "standard input ended; --readings FILE, --reading or --pictures FOLDER needs no answers" in said
    assert "test 'dodo rig measure'" in others[0]
    assert not place.rig.received


@pytest.mark.realtime
def test_readings_are_shown_when_the_answers_end_early(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", Operator(place.rig, {1: "\n", 2: "-700 mm\n", 3: ""}.get))
    said = place.dodo("rig", "measure", "fake", "--axes", "x", code=2)
    assert "nothing is written; the readings until then:\nx:\n  - {steps: " in said
    assert "reads: -700.0000 mm}\n" in said and "standard input ended" in said
