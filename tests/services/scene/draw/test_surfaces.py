import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dodo_dsl.opendlv.assets.problem import InputError
from services.scene.camera import CameraPose, Pinhole, View
from services.scene.surfaces import Face, TextureMap, draw_backdrop, patches
from services.scene.textures import Texture, load_picture

SKY, GROUND = (255.0, 0.0, 0.0, 255.0), (0.0, 255.0, 0.0, 255.0)


def draw_face(image: np.ndarray, view: View, face: Face) -> None:
    for patch in patches(view, face):
        patch.draw(image)


def waves(size: int) -> np.ndarray:
    """A soft picture that repeats without a seam, so that its resolution hardly matters."""
    turns = 2 * np.pi * (np.arange(size) + 0.5) / size
    blue = 128 + 90 * np.sin(turns)[None, :] + 0 * turns[:, None]
    green = 128 + 90 * np.cos(turns)[:, None] + 0 * turns[None, :]
    red = 128 + 60 * np.sin(turns)[None, :] * np.sin(turns)[:, None]
    return np.rint(np.stack([blue, green, red], axis=-1)).astype(np.uint8)


def waves_at(s: np.ndarray, t: np.ndarray) -> np.ndarray:
    s, t = 2 * np.pi * s, 2 * np.pi * t
    return np.stack([128 + 90 * np.sin(s), 128 + 90 * np.cos(t), 128 + 60 * np.sin(s) * np.sin(t)], axis=-1)


def floor(half: float, tile: float, size: int) -> Face:
    points = np.array([[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]])
    lie = TextureMap(
        Texture(waves(size)), np.array([0.3, 0.1, 0.0]), np.array([tile, 0.0, 0.0]), np.array([0.0, tile, 0.0])
    )
    return Face(points, np.array([0.0, 0.0, 1.0]), 0.0, lie)


def traced(camera: Pinhole, pose: CameraPose, half: float, tile: float) -> tuple[np.ndarray, np.ndarray]:
    """The same floor by one ray a pixel: colours (h, w, 3) and where it is met at all (h, w)."""
    v, u = np.mgrid[0 : camera.height, 0 : camera.width] + 0.5
    left, up = (camera.width / 2 - u) / camera.focal, (camera.height / 2 - v) / camera.focal
    rays = np.stack([np.ones_like(left), left, up], axis=-1) @ pose.rotation.T
    with np.errstate(divide="ignore", invalid="ignore"):
        spots = pose.position[:2] - rays[..., :2] * (pose.position[2] / rays[..., 2:])
        met = (rays[..., 2] < 0) & (np.abs(spots) < half).all(axis=-1)
        return waves_at((spots[..., 0] - 0.3) / tile, (spots[..., 1] - 0.1) / tile), met


@settings(max_examples=25, deadline=None)
@given(
    st.floats(-1, 1), st.floats(0.3, 2), st.floats(-0.3, 0.3), st.floats(0.0, 1.2), st.floats(-3.1, 3.1),
    st.sampled_from([16, 64, 333]),
)  # fmt: skip
@pytest.mark.thorough
def test_a_textured_floor_is_what_rays_see(x, z, roll, pitch, yaw, size):
    camera, pose = Pinhole(160, 120, math.radians(60)), CameraPose.at(x, -x, z, roll, pitch, yaw)
    image = np.zeros((120, 160, 4), np.uint8)
    draw_face(image, camera.view(pose), floor(4.0, 2.0, size))
    colours, met = traced(camera, pose, 4.0, 2.0)
    drawn = image[..., 3] > 0
    assert (drawn != met).sum() <= 0.02 * met.size
    both = drawn & met
    assert both.any() == met.any()
    if both.sum() > 500:
        error = np.abs(image[..., :3] - colours)[both]
        assert np.percentile(error, 90) < (14 if size == 16 else 7)


def test_a_fine_texture_is_sharp_when_near_and_its_mean_when_far():
    noise = np.random.RandomState(3).randint(0, 256, (256, 256, 3)).astype(np.uint8)
    lie = TextureMap(Texture(noise), np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]))
    face = Face(floor(50, 1, 8).points, np.array([0.0, 0.0, 1.0]), 0.0, lie)
    camera, image, spread = Pinhole(128, 96, 1.0), np.zeros((96, 128, 4), np.uint8), []
    for height in (0.2, 4.0, 40.0):
        draw_face(image, camera.view(CameraPose.at(0.3, 0.3, height, pitch=math.pi / 2)), face)
        spread.append(float(image[..., 0].std()))
    assert spread[0] > 45  # of the 74 of the noise; interpolation between texels takes some
    assert 5 < spread[1] < 30
    assert spread[2] < 3
    assert image[..., :3].mean() == pytest.approx(127.5, abs=1)


def test_a_roll_tilts_and_a_pitch_moves_the_horizon():
    camera, image = Pinhole(200, 200, math.radians(90)), np.zeros((200, 200, 4), np.uint8)
    draw_backdrop(image, camera.view(CameraPose.at(0, 0, 1, pitch=math.atan(0.5))), SKY, GROUND)
    assert [(image[row, 7] == SKY).all() for row in (49, 50)] == [True, False]  # looking down lifts it
    draw_backdrop(image, camera.view(CameraPose.at(0, 0, 1, roll=math.atan(0.5))), SKY, GROUND)
    rows = [(image[:, column] == SKY).all(axis=-1).sum() for column in (0, 199)]
    assert rows == pytest.approx([150, 50], abs=1)  # the right side of the camera is low: the ground is there


def test_what_is_no_picture_is_told(tmp_path):
    for content in (b"", b"no picture"):
        (tmp_path / "a.png").write_bytes(content)
        with pytest.raises(InputError, match=r"a\.png: not a readable image"):
            load_picture(tmp_path / "a.png")
