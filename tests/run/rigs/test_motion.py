"""The firmware's constants as commands know them: those of its table, which services have, too."""

import math

import pytest

from dodo_dsl.cli import rig_measure
from dodo_dsl.run.rigs import permission
from dodo_dsl.spec.rig import LIMIT_UNITS
from services.gantry import memory, rig_table
from services.gantry.motion import FARTHEST_OFFSET


def test_constants_are_those_of_the_firmware() -> None:
    steps = {f"steps-{axis}": value for axis, value in rig_table.STEPS.items()}
    assert {**steps, "offset-yaw": rig_table.OFFSETS["yaw"]} == permission.BUILT_IN
    assert permission.BUILT_IN_CIRCLE["steps-yaw"] == pytest.approx(rig_table.CIRCLE_STEPS / 360)
    assert permission.BUILT_IN_CIRCLE["offset-yaw"] == rig_table.CIRCLE_OFFSET


def test_offsets_that_are_measured_are_those_that_the_gantry_takes() -> None:
    middles = rig_table.OFFSETS["yaw"], rig_table.CIRCLE_OFFSET
    assert tuple((m - FARTHEST_OFFSET, m + FARTHEST_OFFSET) for m in middles) == rig_measure.OFFSETS


def test_limits_have_the_names_and_units_of_the_gantry() -> None:
    assert list(LIMIT_UNITS.items()) == list(memory.UNITS.items())


@pytest.mark.parametrize("value", ["nan", "inf", "fast", ""])
def test_what_is_no_number_bounds_nothing(value: str) -> None:
    """A compiled file is only a file; the operator's limits refuse what is unlimited."""
    kept = f"speed={value}"
    assert permission.motion_of({"max-speed": value, "limits": "speed=0.2"}).limits["speed"] == math.inf
    assert permission.motion_of({"max-speed": "0.2", "limits": kept}).limits["speed"] == math.inf
    longer = permission.motion_of({"range-x": "0.5", "limits": "x=0.5", "steps-x": value})
    assert longer.by({})["x"] == math.inf
    whole = permission.motion_of({"max-speed": "0.2", "limits": "speed=0.2"})
    assert whole.limits["speed"] == 0.2
