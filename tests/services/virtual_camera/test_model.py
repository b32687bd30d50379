import math
from types import SimpleNamespace

import numpy as np
import pytest

from services.base import UnusableMessageError
from services.scene.camera import CameraPose, mount
from services.scene.render import Renderer
from services.scene.scene import load_scene
from services.virtual_camera.model import VirtualCamera


def frame(x=0.0, y=0.0, z=0.0, yaw=0.0, **changes):
    fields = {"x": x, "y": y, "z": z, "qx": 0.0, "qy": 0.0, "qz": math.sin(yaw / 2), "qw": math.cos(yaw / 2)}
    return SimpleNamespace(**{**fields, **changes})


class Pictures(list):
    """Keeps what is published."""

    def __call__(self, argb, i420, sample_time):
        self.append((argb.copy(), i420.copy(), sample_time))


@pytest.fixture
def renderer(cube_at):
    return Renderer(load_scene(cube_at([3, 0.2, 0, 0.3])), 64, 48, 1.0)


@pytest.fixture
def pictures():
    return Pictures()


def test_a_picture_shows_the_latest_frame_and_bears_the_time_of_the_update(renderer, pictures):
    camera = VirtualCamera(renderer, mount(0.1, -0.05, 0.3, 2.0, -5.0, 10.0), pictures)
    camera.take_frame(frame(9, 9), 5)
    camera.take_frame(frame(1.0, 0.5, 0.0, 0.4), 7)
    camera.update(1_000_000)
    camera.update(1_100_000)
    expected = renderer.render(
        CameraPose.at(
            1 + 0.1 * math.cos(0.4) + 0.05 * math.sin(0.4), 0.5 + 0.1 * math.sin(0.4) - 0.05 * math.cos(0.4), 0.3,
            math.radians(2.0), math.radians(5.0), 0.4 + math.radians(10.0),
        )
    )  # fmt: skip
    assert [time for _, _, time in pictures] == [1_000_000, 1_100_000]
    assert all(np.array_equal(argb, expected) for argb, _, _ in pictures)


@pytest.mark.parametrize("bad", [{"qw": 0.0}, {"x": math.nan}, {"y": math.inf}, {"z": 2e6}, {"qx": math.nan}])
def test_a_frame_without_a_pose_is_refused(renderer, pictures, bad):
    camera = VirtualCamera(renderer, mount(0, 0, 0.1, 0, 0, 0), pictures)
    camera.take_frame(frame(), 0)
    with pytest.raises(UnusableMessageError):
        camera.take_frame(frame(**bad), 1)
    camera.update(3)
    assert len(pictures) == 1
