"""Cameras that containers of DoDo's cannot have."""

from dataclasses import replace

import pytest

from dodo_dsl.plan.model import Flag
from dodo_dsl.run.docker.containers import refuse_rpicam
from dodo_dsl.run.protocol import BackendError
from tests.run.scripted import plan


def test_the_camera_of_a_raspberry_pi_is_refused() -> None:
    made = plan()
    refuse_rpicam(made)
    camera, *others = made.services
    devices = replace(camera, flags=(Flag("source", "/dev/video0"), Flag("name.argb", "rpicam")))
    refuse_rpicam(replace(made, services=(devices, *others)))
    pipe = replace(camera, flags=(Flag("source", "rpicam"),))
    with pytest.raises(BackendError, match=r"needs the program rpicam-vid .*: use --backend mixed or process"):
        refuse_rpicam(replace(made, services=(pipe, *others)))
