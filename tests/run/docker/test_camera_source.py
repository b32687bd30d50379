"""Cameras that containers of DoDo's cannot have."""

from dataclasses import replace

from dodo_dsl.plan.model import Flag
from dodo_dsl.run.docker.containers import unfit_camera
from tests.run.scripted import plan


def test_the_camera_of_a_raspberry_pi_is_refused() -> None:
    made = plan()
    assert not unfit_camera(made)
    camera, *others = made.services
    devices = replace(camera, flags=(Flag("source", "/dev/video0"), Flag("name.argb", "rpicam")))
    assert not unfit_camera(replace(made, services=(devices, *others)))
    pipe = replace(camera, flags=(Flag("source", "rpicam"),))
    said = unfit_camera(replace(made, services=(pipe, *others)))
    assert "needs the program rpicam-vid " in said and said.endswith(": use --backend mixed or process")
