import cv2
import numpy as np

from services.scene.raster import fill


def covered(polygon: np.ndarray, size: int) -> np.ndarray:
    """The pixels whose centres lie in a convex polygon, by its edges' half planes."""
    rows, columns = np.mgrid[0:size, 0:size]
    following = np.roll(polygon, -1, axis=0)
    sides = [
        (b[0] - a[0]) * (rows - a[1]) - (b[1] - a[1]) * (columns - a[0])
        for a, b in zip(polygon, following, strict=True)
    ]
    return np.all([s >= 0 for s in sides], axis=0) | np.all([s <= 0 for s in sides], axis=0)


def test_a_rectangle_fills_the_pixels_whose_centres_it_holds():
    image = np.zeros((12, 12), np.uint8)
    fill(image, np.array([[2.5, 3.5], [7.5, 3.5], [7.5, 5.5], [2.5, 5.5]]), (9,))
    expected = np.zeros_like(image)
    expected[4:6, 3:8] = 9
    assert np.array_equal(image, expected)


def test_polygons_are_neither_too_wide_nor_too_thin_on_average():
    random = np.random.default_rng(5)
    extra, edge = 0, 0.0
    for _ in range(400):
        cloud = random.uniform(30, 34, 2) + random.normal(size=(7, 2)) * random.choice([3, 8])
        polygon = cv2.convexHull(cloud.astype(np.float32))[:, 0].astype(float)
        image = np.zeros((64, 64), np.uint8)
        fill(image, polygon, (1,))
        extra += int(image.sum()) - int(covered(polygon, 64).sum())
        edge += float(np.linalg.norm(polygon - np.roll(polygon, 1, axis=0), axis=1).sum())
    assert abs(extra) < 0.06 * edge
