"""Manual control of a rig on a pseudo terminal."""

import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from services.gantry.manual import main
from tests.services.gantry.fake_rig import FakeRig


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[FakeRig]:
    with FakeRig(tmp_path / "rig") as one:
        yield one


def manual(rig: FakeRig, *words: str, code: int = 0) -> dict[str, Any]:
    output = io.StringIO()
    assert main([f"--serial={rig.path}", *words], output) == code, output.getvalue()
    result: dict[str, Any] = json.loads(output.getvalue())
    return result


@pytest.mark.parametrize("words", [("goto", "2", "0", "0"), ("--range-x=0.5", "goto", "0", "0", "0")])
def test_out_of_the_ranges_nothing_moves(rig: FakeRig, words: tuple[str, ...]) -> None:
    assert "out of the rig's ranges" in manual(rig, *words, code=2)["error"]
    assert not rig.received


@pytest.mark.parametrize("words", [(), ("dance",), ("goto", "1"), ("goto", "nan", "0", "0"), ("--cid=x", "status")])
def test_usage(rig: FakeRig, words: tuple[str, ...]) -> None:
    assert manual(rig, *words, code=2)["error"]
    assert not rig.received


def test_uncalibrated(rig: FakeRig) -> None:
    rig.calibrated = False
    assert manual(rig, "status")["word"] == "not calibrated"
    assert "is not calibrated" in manual(rig, "goto", "0", "0", "0", code=1)["error"]
    assert not rig.commands("GOTO")
    assert manual(rig, "calibrate")["status"] == 0


def test_check_of_a_good_rig(rig: FakeRig) -> None:
    rig.at = [-0.85, -0.65, -2.5]
    result = manual(rig, "check")
    assert result["ok"] and result["word"] == "idle"
