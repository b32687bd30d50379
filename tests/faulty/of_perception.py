"""Faults of what the application sees: pictures, cones and their boxes."""

import random
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from tests.faulty.kiwi import Cones, Make, Program, finding, numbered, seeing

SEED = 7
LATER = 30
WIDTH, HEIGHT = 640, 480
OTHER = {"yellow": "blue", "blue": "yellow"}


def each_cone(change: Callable[[Any], Any]) -> Make:
    """Every cone changed by itself; ones that become None are not found."""
    return finding(lambda cones: [new for new in map(change, cones) if new is not None])


def swapped(cone: Any) -> Any:
    """Yellow taken for blue and blue for yellow."""
    return cone._replace(colour=OTHER[cone.colour])


def without(colour: str) -> Make:
    """A colour that is never found."""
    return each_cone(lambda cone: None if cone.colour == colour else cone)


def smaller_than(height: float) -> Make:
    """No cones that are less high than a fraction of the image."""
    return each_cone(lambda cone: cone if cone.height >= height else None)


def scaled(factor: float) -> Make:
    """Boxes too large, about the same middle of the same lower edge."""
    return each_cone(
        lambda cone: cone._replace(
            x=cone.x - (factor - 1) * cone.width / 2,
            y=cone.y - (factor - 1) * cone.height,
            width=factor * cone.width,
            height=factor * cone.height,
        )
    )


def shifted(right: float) -> Make:
    """Boxes moved by a fraction of the image's width."""
    return each_cone(lambda cone: cone._replace(x=cone.x + right))


def in_pixels(cone: Any) -> Any:
    """Boxes in pixels."""
    return cone._replace(x=cone.x * WIDTH, y=cone.y * HEIGHT, width=cone.width * WIDTH, height=cone.height * HEIGHT)


def doubled(cones: Cones) -> Cones:
    """Every cone found twice."""
    return [*cones, *cones]


def late() -> Make:
    """The cones of the frame before, none at first."""
    last: list[Cones] = [[]]

    def change(cones: Cones) -> Cones:
        last.append(cones)
        return last.pop(0)

    return finding(change)


def from_frame(frames: int, change: Callable[[Cones], Cones]) -> Make:
    """Cones changed in all frames after the first ones."""
    number = numbered()
    return finding(lambda cones: change(cones) if number() >= frames else cones)


def ghosts(count: int) -> Make:
    """Cones that are not there, in other places in every frame, the same in every run."""

    def make(perception: Program) -> None:
        draw = random.Random(SEED)

        def ghost() -> Any:
            colour = draw.choice(("yellow", "blue"))
            return perception.Patch(colour, draw.uniform(0.1, 0.8), draw.uniform(0.55, 0.8), 0.03, 0.07)

        finding(lambda cones: [*cones, *(ghost() for _ in range(count))])(perception)

    return make


def previous() -> Make:
    """The picture before, the first one twice."""
    kept: list[Any] = []

    def change(image: Any) -> Any:
        kept.append(image)
        return kept.pop(0) if len(kept) > 1 else image

    return seeing(change)


def mirrored(image: Any) -> Any:
    """Left and right exchanged."""
    return np.ascontiguousarray(image[:, ::-1])


def red_for_blue(image: Any) -> Any:
    """Red and blue exchanged."""
    return np.ascontiguousarray(image[:, :, [2, 1, 0, 3]])


def i420_as_argb(image: Any) -> Any:
    """The bytes of the I420 picture, 12 bits a pixel, read as 4 bytes a pixel; nothing where they end."""
    read = np.zeros(image.size, np.uint8)
    planes = cv2.cvtColor(image, cv2.COLOR_BGRA2YUV_I420).reshape(-1)
    read[: planes.size] = planes
    return read.reshape(image.shape)


PERCEPTION_FAULTS: dict[str, Make] = {
    "colours-swapped": each_cone(swapped),
    "yellow-ignored": without("yellow"),
    "blue-ignored": without("blue"),
    "far-missed": smaller_than(30 / HEIGHT),
    "boxes-large": scaled(1.5),
    "boxes-shifted": shifted(20 / WIDTH),
    "boxes-doubled": finding(doubled),
    "ghosts": ghosts(3),
    "blind": finding(lambda _: []),
    "blind-later": from_frame(LATER, lambda _: []),
    "pixels": each_cone(in_pixels),
    "frame-late": late(),
    "picture-previous": previous(),
    "picture-mirrored": seeing(mirrored),
    "picture-red-blue": seeing(red_for_blue),
    "picture-i420": seeing(i420_as_argb),
}
