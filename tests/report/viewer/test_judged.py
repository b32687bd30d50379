"""What evaluators looked at: targets as the evaluator reads them, and the map by its roles."""

import base64
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dodo_dsl.plan.model import Flag, Plan, PlannedService
from dodo_dsl.plan.plan_json import from_json
from dodo_dsl.report.viewer import judged, recorded, scene
from services.continuous_signal.csv_target import read_table
from services.continuous_signal.recorded_target import read_recording
from services.continuous_signal.signals import Signal
from tests.report.viewer import failures
from tests.report.viewer.drives import EPOCH, GOLDEN, MESSAGES, ROOT, MadeDrive, Sample, record, requests

STEERING = "opendlv.proxy.GroundSteeringRequest"


def plan(*flags: Flag) -> Plan:
    named = (Flag("message", STEERING), Flag("field", "groundSteering"), Flag("sender", "0"), *flags)
    judge = PlannedService("evaluation", "signal", "continuous-signal", "x", (), named, judge=True)
    whole = from_json((GOLDEN / "sil-closed-straight" / "test.json").read_text())
    return replace(whole, services=(judge,))


def described(folder: Path, tested: Plan, samples: list[Sample]) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Times and values of the target."""
    record(folder / "test.rec", MadeDrive("x", 5.0, samples, {}))
    test = recorded.read(folder / "test.rec", MESSAGES)
    (signal,) = judged.judged(tested, folder, test, MESSAGES)
    times, values = (np.frombuffer(base64.b64decode(signal["target"][key]), "<f4") for key in ("times", "values"))
    return times, values


def test_the_target_of_a_table(tmp_path: Path) -> None:
    (tmp_path / "files").symlink_to(ROOT / "tests_registry")
    times, values = described(tmp_path, plan(Flag("target", "targets/straight.csv", "path")), [])
    expected = read_table(ROOT / "tests_registry" / "targets" / "straight.csv", "groundSteering", False)
    assert times == pytest.approx(expected.times / 1e6, abs=1e-6)
    assert values == pytest.approx(expected.values, abs=1e-6)


@pytest.mark.parametrize(("first", "zero"), [(EPOCH / 1e6 + 0.5, 0.5), (1e6, 0.0)])
def test_the_target_of_a_table_of_sample_times(tmp_path: Path, first: float, zero: float) -> None:
    """In the test's time, or from its first row on where it is of another day."""
    (tmp_path / "files").mkdir()
    (tmp_path / "files" / "t.csv").write_text(f"time,value\n{first},1\n{first + 1},2\n")
    flags = Flag("target", "t.csv", "path"), Flag("align", "sample-time")
    times, values = described(tmp_path, plan(*flags), [])
    assert (times.tolist(), values.tolist()) == ([zero, zero + 1], [1.0, 2.0])


@pytest.mark.parametrize("align", ["begin", "sample-time"])
def test_the_target_of_a_recording(tmp_path: Path, align: str) -> None:
    (tmp_path / "files").mkdir()
    record(tmp_path / "files" / "t.rec", MadeDrive("x", 3.0, list(requests(lambda t: t / 10, 2.0)), {}))
    flags = Flag("target", "t.rec", "path"), Flag("align", align)
    times, values = described(tmp_path, plan(*flags), [])
    expected = read_recording(tmp_path / "files" / "t.rec", Signal(STEERING, 0, "groundSteering"), MESSAGES)
    assert times == pytest.approx(expected.times / 1e6)
    assert values == pytest.approx(expected.values)


def test_a_live_target_and_none(tmp_path: Path) -> None:
    live = [(0.5, STEERING, 9, {"groundSteering": 0.25})]
    times, values = described(tmp_path, plan(Flag("target-sender", "9")), live)
    assert (times.tolist(), values.tolist()) == ([0.5], [0.25])
    (tmp_path / "test.rec").unlink()
    assert not described(tmp_path, plan(Flag("target", "gone.csv", "path")), [])[0].size


def test_lines_of_the_map_have_roles(tmp_path: Path) -> None:
    (tmp_path / "files").symlink_to(ROOT / "tests_registry")
    whole = from_json((GOLDEN / failures.wall_hit().slug / "test.json").read_text())
    shown = scene.scene(whole, tmp_path)
    assert {line["name"]: line["role"] for line in shown["lines"]} == {
        "left": "wall",
        "right": "wall",
        "finish": "goal",
    }
    assert (shown["length"], shown["width"], shown["frame"]["sender"]) == (0.36, 0.16, 0)


def test_a_target_that_cannot_be_read_is_said(tmp_path: Path) -> None:
    record(tmp_path / "test.rec", MadeDrive("x", 5.0, [], {}))
    test = recorded.read(tmp_path / "test.rec", MESSAGES)
    (signal,) = judged.judged(plan(Flag("target", "none.csv", "path")), tmp_path, test, MESSAGES)
    assert signal["problem"] == "its target is not shown: No such file or directory"
    assert signal["target"] == {"times": "", "values": ""}
