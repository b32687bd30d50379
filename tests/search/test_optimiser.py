"""What is expected between drives."""

import numpy as np
import pytest

from dodo_dsl.search.optimiser import fitted

POINTS = np.random.default_rng(5).random((40, 3))
NONE = np.array([False, False, False])


def height(points: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    return np.sin(4 * points[:, 0]) + points[:, 1] ** 2


def test_margins_between_drives() -> None:
    found = fitted(POINTS, height(POINTS), NONE)
    others = 0.1 + 0.8 * np.random.default_rng(6).random((30, 3))
    mean, deviation = found.expect(others)
    assert np.abs(mean - height(others)).max() < 0.15
    assert (np.abs(mean - height(others)) < 4 * deviation + 0.02).all()
    assert found.scales[2] > max(found.scales[:2])


def test_little_is_known_far_from_drives() -> None:
    found = fitted(POINTS, height(POINTS), NONE)
    _, (near, far) = found.expect(np.array([POINTS[0] + 0.001, [3.0, 3.0, 0.5]]))
    assert near < 0.2 * far


def test_what_is_believed_is_known_better_and_expected_as_before() -> None:
    found, place = fitted(POINTS, height(POINTS), NONE), np.array([[1.2, 1.2, 0.5]])
    before, after = found.expect(place), found.believing(place).expect(place)
    assert after[0] == pytest.approx(before[0], abs=0.01)
    assert after[1] < 0.5 * before[1]


def test_values_of_a_list_are_equally_far_from_each_other() -> None:
    points = np.array([[0.1], [0.5], [0.9]] * 3)
    found = fitted(points, np.array([1.0, 0.0, 0.5] * 3), np.array([True]))
    assert found.expect(points[:3])[0] == pytest.approx([1.0, 0.0, 0.5], abs=0.01)
