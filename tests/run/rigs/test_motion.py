"""The firmware's constants as commands know them: those of its table, which services have, too."""

import pytest

from dodo_dsl.cli.rig import measure_command
from dodo_dsl.run.rigs import motion
from services.gantry import rig_table
from services.gantry.conversion import FARTHEST_OFFSET


def test_constants_are_those_of_the_firmware() -> None:
    steps = {f"steps-{axis}": value for axis, value in rig_table.STEPS.items()}
    assert {**steps, "offset-yaw": rig_table.OFFSETS["yaw"]} == motion.BUILT_IN
    assert motion.BUILT_IN_CIRCLE["steps-yaw"] == pytest.approx(rig_table.CIRCLE_STEPS / 360)
    assert motion.BUILT_IN_CIRCLE["offset-yaw"] == rig_table.CIRCLE_OFFSET


def test_offsets_that_are_measured_are_those_that_the_gantry_takes() -> None:
    middles = rig_table.OFFSETS["yaw"], rig_table.CIRCLE_OFFSET
    assert tuple((m - FARTHEST_OFFSET, m + FARTHEST_OFFSET) for m in middles) == measure_command.OFFSETS
