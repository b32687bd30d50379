import numpy as np
import pytest

from services.virtual_camera.optics import GAMMA, Sensor


def developed(sensor, value=100, sample_time=5, size=(120, 200)):
    picture = np.full((*size, 4), value, np.uint8)
    picture[..., 3] = 255
    sensor.develop(picture, sample_time)
    assert (picture[..., 3] == 255).all()
    return picture[..., :3].astype(float)


@pytest.mark.parametrize("light", [0.1, 0.5, 2.0])
@pytest.mark.parametrize("key", ["exposure", "gain"])
def test_more_light_is_brighter_by_the_gamma_law(key, light):
    assert developed(Sensor(**{key: light})).mean() == pytest.approx(100 * light ** (1 / GAMMA), abs=0.5)


@pytest.mark.parametrize("noise", [0.01, 0.05])
def test_noise_has_its_deviation_and_no_bias(noise):
    values = developed(Sensor(noise=noise, seed=4), 128)
    assert values.mean() == pytest.approx(128, abs=0.3)
    assert values.std() == pytest.approx(noise * 255, rel=0.05)
    colours = values.reshape(-1, 3).T
    assert np.abs(np.corrcoef(colours) - np.eye(3)).max() < 0.05


def test_seed_and_time_decide_the_noise_and_what_came_before_does_not():
    sensor = Sensor(noise=0.1, seed=7)
    pictures = []
    for time in (1, 2, 1, 1 + (1 << 32)):
        picture = np.full((40, 60, 4), 128, np.uint8)
        sensor.develop(picture, time)
        pictures.append(picture)
    first, second, again, later = pictures
    assert np.array_equal(first, again)
    assert not np.array_equal(first, second)
    assert not np.array_equal(first, later)
    assert not np.array_equal(developed(Sensor(noise=0.1, seed=7)), developed(Sensor(noise=0.1, seed=8)))
