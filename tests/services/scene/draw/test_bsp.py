import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dodo_dsl.opendlv.assets.map_file import Instance
from services.scene.bsp import Tree
from services.scene.surfaces import Face, box_faces

WHITE = (255.0, 255.0, 255.0, 255.0)


def boxes(seed: int) -> list[Face]:
    """Some boxes of all sizes and turns, many of which intersect."""
    random = np.random.default_rng(seed)
    faces = []
    for _ in range(random.integers(1, 6)):
        x, y, z = random.uniform(-3, 3, 3)
        instance = Instance(float(x), float(y), float(z), float(random.uniform(-3, 3)))
        faces += box_faces(tuple(random.uniform(0.3, 4, 3)), instance, WHITE)
    return faces


def hit(face: Face, eye: np.ndarray, ray: np.ndarray) -> float | None:
    """How far along a ray it meets the front of a face."""
    slope = float(face.normal @ ray)
    if slope > -1e-9:
        return None
    far = (face.offset - float(face.normal @ eye)) / slope
    spot = eye + far * ray
    edges = np.roll(face.points, -1, axis=0) - face.points
    inside = np.cross(edges, spot - face.points) @ face.normal
    same_side = bool((inside > 1e-6).all() or (inside < -1e-6).all())
    return far if far > 1e-6 and same_side else None


@pytest.mark.slow
@settings(deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 10**6))
def test_what_a_ray_meets_first_is_drawn_last(scene, rays):
    tree, random = Tree(boxes(scene)), np.random.default_rng(rays)
    eye = random.uniform(-6, 6, 3)
    drawn = [item for item in tree.back_to_front(eye) if isinstance(item, Face)]
    for _ in range(10):
        ray = random.normal(size=3)
        met = [far for face in drawn if (far := hit(face, eye, ray)) is not None]
        assert met == sorted(met, reverse=True)


@pytest.mark.slow
@settings(deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 10**6))
def test_a_place_is_drawn_after_what_lies_behind_it_and_before_what_hides_it(scene, places):
    tree, random = Tree(boxes(scene)), np.random.default_rng(places)
    eye, spot = random.uniform(-6, 6, (2, 3))
    order = list(tree.back_to_front(eye))
    at = order.index(int(tree.locate(spot[None])[0]))
    for number, face in enumerate(order):
        far = None if isinstance(face, int) else hit(face, eye, spot - eye)
        if far is not None and abs(far - 1) > 1e-6:
            assert (number > at) == (far < 1)


def test_a_box_is_centred_and_turned_as_opendlv_does():
    faces = box_faces((4.0, 2.0, 1.0), Instance(10.0, 0.0, 0.5, 0.5), WHITE)
    corners = np.concatenate([face.points for face in faces])
    assert (corners[:, 2].min(), corners[:, 2].max()) == pytest.approx((0.0, 1.0))
    turn = np.pi - 0.5
    longest = np.array([np.cos(turn), np.sin(turn), 0.0])
    assert ((corners - [10, 0, 0.5]) @ longest).max() == pytest.approx(2.0)
    assert all(float(f.normal @ (f.points.mean(axis=0) - [10, 0, 0.5])) > 0 for f in faces)
