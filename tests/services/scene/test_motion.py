import math

import numpy as np
import pytest

from services.scene.camera import CameraMotion, CameraPose, Pinhole, motion_between
from services.scene.render import Renderer
from services.scene.scene import load_scene
from services.virtual_camera.optics import Optics

BODY = CameraPose.at(0, 0, 0)


def test_two_poses_tell_the_velocity_and_the_spin():
    motion = motion_between(CameraPose.at(0, 0, 0), CameraPose.at(0.1, 0.2, 0, yaw=0.05), 50_000)
    assert motion.velocity == pytest.approx([2, 4, 0])
    assert motion.spin == pytest.approx([0, 0, 1])
    later = motion.after(0.1)
    assert later.position == pytest.approx([0.3, 0.6, 0])
    assert later.rotation @ [1, 0, 0] == pytest.approx([math.cos(0.15), math.sin(0.15), 0])


@pytest.mark.parametrize(("far", "gap"), [(0.1, 0), (0.1, -5), (0.1, 2_000_000), (90.0, 100_000)])
def test_gaps_and_jumps_are_no_motion(far, gap):
    motion = motion_between(CameraPose.at(0, 0, 0), CameraPose.at(far, 0, 0), gap)
    assert not motion.velocity.any()
    assert motion.after(1.0) is motion.pose


def expose(scene, motion, shutter):
    optics, out = Optics(Pinhole(160, 120, 1.0), shutter=shutter), np.empty((120, 160, 4), np.uint8)
    optics.expose(Renderer(scene, 160, 120, 1.0), motion, BODY, 0, out)
    return out


def test_a_turning_camera_smears_edges_as_wide_as_it_turns(cube_at):
    """A red cube on a white floor: between its colour and the floor's there are as many columns as the turn has."""
    scene, pose = load_scene(cube_at([3, 0, 0, 0])), CameraPose.at(0, 0, 0.5)
    sharp, blurred = (expose(scene, CameraMotion(pose, np.zeros(3), np.array([0, 0, 1.0])), s) for s in (0.0, 0.08))
    assert np.array_equal(sharp, Renderer(scene, 160, 120, 1.0).render(pose))
    edges = [np.flatnonzero((row[:, 0] > 5) & (row[:, 0] < 200))[:80] for row in (sharp[62], blurred[62])]
    turned = Pinhole(160, 120, 1.0).focal * 0.08
    assert len(edges[0]) == 0
    assert len(edges[1]) == pytest.approx(2 * turned, rel=0.35)
    middle = (edges[1].min() + edges[1].max()) / 2
    assert middle == pytest.approx(79.5, abs=1.5)  # the shutter is open as long before as after


@pytest.mark.parametrize(("blur", "count"), [(0, 1), (3, 1), (3.1, 3), (15, 3), (15.1, 5), (27.1, 7), (1000, 7)])
def test_the_pictures_are_an_odd_number_and_not_far_apart(blur, count):
    camera = Pinhole(640, 480, 0.85)
    motion = CameraMotion(CameraPose.at(0, 0, 0), np.zeros(3), np.array([0, 0, blur / camera.focal / 0.01]))
    assert motion.steps(camera, 0.01) == count
