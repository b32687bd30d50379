"""Find the cones and other cars in the frames of the car's camera and send them on the bus.

    python perception.py --cid=111 --name=video0.argb --width=640 --height=480 --verbose

Reads shared memory, 4 bytes a pixel (blue, green, red, alpha). Sends for each cone and car, with the frame's time
stamp as sample time and the frame's number as sampleId: DetectionType (1 yellow, 2 blue, 3 car), DetectionProperty
(`yellow`, `blue`, `car`) and DetectionBoundingBox (fractions of the image). When all of a frame have been sent,
also when there are none, an ImageReadingShm with the same sampleId shows that the frame is complete.
"""

import argparse
import contextlib
import itertools
import math
import signal
import sys
import time
from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np
from cv2.typing import MatLike, Rect

from dodo_dsl.opendlv import Session, SharedMemory, SharedMemoryError

TYPES = {"yellow": 1, "blue": 2, "car": 3}
HSV_RANGES = {"yellow": ((22, 150, 45), (36, 255, 255)), "blue": ((102, 124, 20), (130, 255, 255))}
CAR = ((145, 120, 40), (170, 255, 255))  # hue, saturation and value of the other car
WHITE = 0.85  # how far the colour of the floor is taken for that of the light
HORIZON = 0.45  # no cone stands higher in the image
SMALLEST = 1 / 14_000  # of the image; less than this is noise: 22 pixels of 640 x 480
SMALLEST_CAR = 1 / 1_000  # of the image
SLENDER = (0.8, 3.5)  # height of a cone's box to its width
FILLED = 0.35  # share of its box that a cone covers
ASKS, LISTENS = 1, 2  # sender stamps of perception's question to steering and of the answer
PATIENCE = 0.02  # seconds between questions and between looks for the camera


class Patch(NamedTuple):
    """A patch's colour, `car` for that of other cars, and box: upper left corner and size as fractions of the image."""

    colour: str
    x: float
    y: float
    width: float
    height: float


def find(image: MatLike) -> list[Patch]:
    """Cones and cars in an image of blue, green, red (and alpha), the nearest cone of each colour first."""
    height, width = image.shape[:2]
    top = int(HORIZON * height)
    ground = image[top:] if image.shape[2] == 3 else cv2.cvtColor(image[top:], cv2.COLOR_BGRA2BGR)
    hsv = cv2.cvtColor(white_balanced(ground), cv2.COLOR_BGR2HSV)
    boxes = {
        colour: _cones(cv2.inRange(hsv, low, high), SMALLEST * width * height)
        for colour, (low, high) in HSV_RANGES.items()
    }
    boxes["car"] = _boxes(cv2.inRange(hsv, *CAR), SMALLEST_CAR * width * height)
    return [
        Patch(colour, x / width, (top + y) / height, w / width, h / height)
        for colour, found in boxes.items()
        for x, y, w, h in found
    ]


def white_balanced(ground: MatLike) -> MatLike:
    """The ground as in white light: most of it is floor, and floors are nearly grey."""
    median = np.median(ground[::8, ::8].reshape(-1, 3), axis=0)
    gains = np.clip(median.mean() / np.maximum(median, 1), 0.5, 2) ** WHITE
    return cv2.multiply(ground, (*gains, 1.0))


def _cones(mask: MatLike, smallest: float) -> list[Rect]:
    """Boxes of the patches in a mask that may be cones, the lowest first."""
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    cones = [box for box in _boxes(mask, smallest) if _may_be_cone(box, mask)]
    return sorted(cones, key=lambda box: -(box[1] + box[3]))


def _boxes(mask: MatLike, smallest: float) -> list[Rect]:
    """Boxes (x, y, width, height in pixels) of the patches in a mask."""
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    return [box for box in map(cv2.boundingRect, contours) if box[2] * box[3] >= smallest]


def _may_be_cone(box: Rect, mask: MatLike) -> bool:
    """Whether a patch is neither as wide nor as high as furniture; one cut off by the image may have any shape."""
    x, y, width, height = box
    cut = x == 0 or x + width == mask.shape[1] or y + height == mask.shape[0]
    filled = cv2.countNonZero(mask[y : y + height, x : x + width]) / (width * height)
    return y > 0 and (cut or (SLENDER[0] <= height / width <= SLENDER[1] and filled >= FILLED))


def announce(session: Session, found: list[Patch], frame: int, sample_time: int, source: argparse.Namespace) -> None:
    """Send what was found in a frame, and that this was all."""
    logic = "opendlv.logic.perception."
    kind, property_, box = (
        session.messages.type(logic + name) for name in ("DetectionType", "DetectionProperty", "DetectionBoundingBox")
    )
    for number, each in enumerate(found):
        key = {"sampleId": frame, "detectionId": number}
        session.send(kind(**key, type=TYPES[each.colour]), sample_time)
        session.send(property_(**key, property=each.colour), sample_time)
        session.send(box(**key, x=each.x, y=each.y, width=each.width, height=each.height), sample_time)
    done = session.messages.type("opendlv.proxy.ImageReadingShm")
    size = {"width": source.width, "height": source.height}
    session.send(done(format="argb", location=source.name, sampleId=frame, **size), sample_time)


def await_steering(session: Session) -> None:
    """Ask until steering answers that it listens, so that it misses no frame."""
    print("perception: waiting for steering", flush=True)
    status = session.messages.type("opendlv.system.SystemStatusMessage")
    asked = -math.inf
    while True:
        if time.monotonic() - asked > PATIENCE:
            asked = time.monotonic()
            session.send(status(description="perception asks"), sender_stamp=ASKS)
        envelope = session.receive(PATIENCE)
        if envelope and (envelope.data_type, envelope.sender_stamp) == (session.messages.id(status), LISTENS):
            return


def attach(name: str) -> SharedMemory:
    """The camera's memory; waits for as long as it is not there."""
    print(f"perception: looking for {name}", flush=True)
    while True:
        with contextlib.suppress(SharedMemoryError):
            return SharedMemory.attach(name)
        time.sleep(PATIENCE)


def watch(memory: SharedMemory, session: Session, numbers: Iterator[int], flags: argparse.Namespace) -> None:
    """Handle each frame that the camera notifies of; raises SharedMemoryError when the camera is gone."""
    pixels = np.frombuffer(memory.buffer, np.uint8).reshape(flags.height, flags.width, 4)
    while True:
        if not memory.wait():
            continue
        with memory.lock():
            image, sample_time = pixels.copy(), memory.sample_time()
        frame, found = next(numbers), find(image)
        announce(session, found, frame, sample_time, flags)
        if flags.verbose:
            cars = sum(patch.colour == "car" for patch in found)
            print(f"frame {frame}: {len(found) - cars} cones{f', {cars} cars' if cars else ''}", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description="Find cones and cars in the frames of a camera.")
    parser.add_argument("--cid", type=int, required=True, help="the bus, 1 to 254")
    parser.add_argument("--name", default="video0.argb", help="the camera's shared memory")
    parser.add_argument("--width", type=int, required=True, help="of the image, in pixels")
    parser.add_argument("--height", type=int, required=True)
    parser.add_argument("--await-steering", action="store_true", help="begin when steering.py listens")
    parser.add_argument("--verbose", action="store_true", help="print what is found")
    flags = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    cv2.setNumThreads(1)  # a frame takes a millisecond: other threads look for work for longer than they help

    numbers, size = itertools.count(), flags.width * flags.height * 4
    with Session(flags.cid) as session:
        if flags.await_steering:
            await_steering(session)
        while True:
            with attach(flags.name) as memory, contextlib.suppress(SharedMemoryError):
                if memory.size != size:
                    print(f"perception: {flags.name} has {memory.size} bytes, not {size}", file=sys.stderr)
                    return 2
                watch(memory, session, numbers, flags)


if __name__ == "__main__":
    sys.exit(main())
