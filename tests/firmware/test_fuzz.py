"""Malformed bytes for the firmware: its core with sanitizers, and its binary through the emulated serial port."""

import runpy
import subprocess
import sys

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from services.gantry.rig_table import BOUNDS, MICROSTEP, Status
from tests.firmware.programs import ROOT, Bench

FUZZ = runpy.run_path(str(ROOT / "scripts" / "fuzz-firmware"), run_name="fuzz")
ONE_BENCH = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]

words = st.sampled_from(["$GOTO", "$RUN", "$STOP", "$CALIBRATE", "$POSITION", "$STATUS", "$", "RUN", "$run"])
numbers = st.one_of(
    st.floats(-4, 4).map(lambda value: f"{value:.6f}"),
    st.integers(-(10**12), 10**12).map(str),
    st.sampled_from(["", "-", "+", ".", "1.", ".1", "1e3", "nan", "0x1", "--1", "1.1.1", "999999999", "-999999999"]),
    st.text("0123456789+-.e", max_size=14),
)
lines = st.one_of(
    st.binary(max_size=90),
    st.builds(lambda w, a: f"{w}:{','.join(a)}".encode(), words, st.lists(numbers, max_size=5)),
    words.map(str.encode),
).map(lambda data: data.replace(b"\n", b""))


speeds = st.one_of(st.sampled_from([-1.0, 1.0]), st.floats(-1, 1))


@settings(max_examples=4 * settings.default.max_examples, deadline=None, suppress_health_check=ONE_BENCH)
@given(data=lines)
@pytest.mark.thorough
def test_only_valid_commands_move_the_core(bench: Bench, data: bytes) -> None:
    moves = FUZZ["valid_motion"](data)
    answers = bench.send(data + b"\n")
    assert len(answers) <= 1
    assert all(answer.startswith("$") and answer.isascii() for answer in answers)
    bench.run(0.02)
    way = bench.extremes()["way"]
    assert moves or way == [0, 0, 0]
    bench.send_line("$STOP")
    if moves:
        bench.run(0.5)
        bench.calibrate() if bench.status() == Status.NOT_CALIBRATED else None
        bench.extremes()


@pytest.mark.slow
@settings(max_examples=25, deadline=None, suppress_health_check=ONE_BENCH)
@given(runs=st.lists(st.tuples(speeds, speeds, speeds, st.floats(0.05, 3)), min_size=1, max_size=6))
def test_no_sequence_of_runs_leaves_the_workspace(bench: Bench, runs: list[tuple[float, ...]]) -> None:
    """Each RUN is repeated as a master does, so that the rig gets fast and meets its edges."""
    events = len(bench.events)
    for vx, vy, vyaw, seconds in runs:
        for _ in range(round(seconds / 0.05)):
            assert bench.send_line(f"$RUN:{vx:.4f},{vy:.4f},{vyaw:.4f}") == []
            bench.run(0.05)
            pose = bench.pose()
            for axis, (low, high) in BOUNDS.items():
                assert low - 2 * MICROSTEP[axis] <= pose[axis] <= high + 2 * MICROSTEP[axis]
    extremes = bench.extremes()
    assert max(extremes["speed"]) <= 1.0
    assert max(extremes["ramp"][:2]) <= 0.5 and extremes["ramp"][2] <= 1.0
    assert bench.events[events:] == []


def test_the_binary_survives_malformed_lines(firmware: None) -> None:
    words = [sys.executable, str(ROOT / "scripts" / "fuzz-firmware"), "2000", "7"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "2,000 lines" in done.stdout
