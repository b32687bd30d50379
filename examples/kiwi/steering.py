"""Steer the car between the yellow cones on its left and the blue ones on its right, and behind other cars.

    python steering.py --cid=111 --verbose

Hears the detections of perception.py: those with one sampleId are a frame, which is complete when its
ImageReadingShm comes. Answers each frame with one GroundSteeringRequest and one PedalPositionRequest that
carry the frame's sample time. `dodo tune` finds values of the three variables STEERING_GAIN, LANE_WIDTH and
PEDAL. `--reverse` steers the other way, for those who want to see a test fail.
"""

import argparse
import math
import os
import signal
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

from dodo_dsl.opendlv import Envelope, Session

CAMERA_HEIGHT = 0.095  # m
FOCAL = 0.5 / math.tan(math.radians(48.8) / 2)  # in heights of the image
ASPECT = 640 / 480
WHEELBASE = 0.224  # m
REQUEST_PER_ANGLE = 0.290888 / 0.6  # the car turns its wheel further than it is asked to
STEERING_LIMIT = 0.290888  # rad

STEERING_GAIN = float(os.environ.get("STEERING_GAIN", "1"))  # above 1 it steers more than the circle needs
TRACK_WIDTH = float(os.environ.get("LANE_WIDTH", "0.5"))  # m, assumed where only one side is seen
PEDAL = float(os.environ.get("PEDAL", "0.08"))  # 0.52 m/s
PEDAL_BLIND = 0.05
STOP, SLOW = 0.45, 1.0  # m to another car, from below the camera: between the two it slows down
BESIDE = 0.25  # m to the side, beyond which a car is not in the way
FRAMES_BLIND = 10  # then stop
ASKS, LISTENS = 1, 2  # sender stamps of perception's question, and that steering listens

HEARD = (
    "opendlv.logic.perception.DetectionProperty",
    "opendlv.logic.perception.DetectionBoundingBox",
    "opendlv.proxy.ImageReadingShm",
    "opendlv.system.SystemStatusMessage",
)
REQUESTS = ("opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest")


class Point(NamedTuple):
    """A position on the ground, seen from below the camera: `ahead` and `left` in m."""

    ahead: float
    left: float


def on_the_ground(x: float, y: float, width: float, height: float) -> Point | None:
    """Where the thing in a box (fractions of the image) stands; None at or above the horizon."""
    below = y + height - 0.5
    if below <= 0:
        return None
    ahead = CAMERA_HEIGHT * FOCAL / below
    return Point(ahead, (0.5 - x - width / 2) * ASPECT * ahead / FOCAL)


def aim_point(yellow: list[Point], blue: list[Point]) -> Point | None:
    """The middle between the nearest cones of both sides; half a track beside that of one side alone."""
    left = min(yellow, default=None)
    right = min(blue, default=None)
    if left and right:
        return Point((left.ahead + right.ahead) / 2, (left.left + right.left) / 2)
    if left:
        return Point(left.ahead, left.left - TRACK_WIDTH / 2)
    if right:
        return Point(right.ahead, right.left + TRACK_WIDTH / 2)
    return None


def steering_towards(aim: Point) -> float:
    """The request in rad that leads onto the circle through the aim point (pure pursuit)."""
    curvature = 2 * aim.left / (aim.ahead**2 + aim.left**2)
    request = STEERING_GAIN * REQUEST_PER_ANGLE * math.atan(WHEELBASE * curvature)
    return max(-STEERING_LIMIT, min(STEERING_LIMIT, request))


def free_way(cars: Sequence[Point]) -> float:
    """How fast to drive behind other cars: 1 if none is near, 0 to stop."""
    ahead = min((car.ahead for car in cars if abs(car.left) < BESIDE), default=SLOW)
    return max(0.0, min(1.0, (ahead - STOP) / (SLOW - STOP)))


class Driver:
    """Chooses steering and pedal, frame by frame; holds its steering for a while when it sees nothing."""

    def __init__(self, reverse: bool = False) -> None:
        self.sign = -1 if reverse else 1
        self.steering = 0.0
        self.blind = 0

    def drive(self, yellow: list[Point], blue: list[Point], cars: Sequence[Point] = ()) -> tuple[float, float]:
        """The steering request (rad, left is positive) and the pedal for a frame's cones and cars."""
        aim, free = aim_point(yellow, blue), free_way(cars)
        if aim is None:
            self.blind += 1
            return self.steering, PEDAL_BLIND * free if self.blind <= FRAMES_BLIND else 0.0
        self.blind = 0
        self.steering = self.sign * steering_towards(aim)
        return self.steering, PEDAL * free


class Frames:
    """Collects the detections of a frame until it is complete."""

    def __init__(self) -> None:
        self.colours: dict[tuple[int, int], str] = {}
        self.places: dict[tuple[int, int], Point] = {}

    def hear(self, message: Any) -> None:
        """Take a DetectionProperty or a DetectionBoundingBox."""
        key = (message.sampleId, message.detectionId)
        if message.DESCRIPTOR.name == "DetectionProperty":
            self.colours[key] = message.property
        else:
            place = on_the_ground(message.x, message.y, message.width, message.height)
            if place:
                self.places[key] = place

    def complete(self, frame: int) -> tuple[list[Point], list[Point], list[Point]]:
        """The yellow and the blue cones of a frame, and the cars; everything heard so far is forgotten."""
        found: dict[str, list[Point]] = {"yellow": [], "blue": [], "car": []}
        for key, place in self.places.items():
            if key[0] == frame and self.colours.get(key) in found:
                found[self.colours[key]].append(place)
        self.colours.clear()
        self.places.clear()
        return found["yellow"], found["blue"], found["car"]


def say_that_it_listens(session: Session) -> None:
    """For perception, which may have started before."""
    status = session.messages.type("opendlv.system.SystemStatusMessage")
    session.send(status(description="steering listens"), sender_stamp=LISTENS)


def handle(session: Session, envelope: Envelope, frames: Frames, driver: Driver, verbose: bool) -> None:
    """Collect a detection, or answer the frame that is complete, or the question whether this program listens."""
    message = session.messages.decode(envelope.data_type, envelope.payload)
    kind = message.DESCRIPTOR.name
    if kind == "SystemStatusMessage":
        if envelope.sender_stamp == ASKS:
            say_that_it_listens(session)
    elif kind != "ImageReadingShm":
        frames.hear(message)
    else:
        angle, pedal = driver.drive(*frames.complete(message.sampleId))
        steer, press = map(session.messages.type, REQUESTS)
        session.send(steer(groundSteering=angle), envelope.sample_time)
        session.send(press(position=pedal), envelope.sample_time)
        if verbose:
            print(f"frame {message.sampleId}: steering {angle:.3f} rad, pedal {pedal:.2f}", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description="Steer between yellow and blue cones.")
    parser.add_argument("--cid", type=int, required=True, help="the bus, 1 to 254")
    parser.add_argument("--reverse", action="store_true", help="steer the other way")
    parser.add_argument("--verbose", action="store_true", help="print what is done")
    flags = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))

    frames, driver = Frames(), Driver(flags.reverse)
    with Session(flags.cid) as session:
        session.hear_only(session.messages.id(name) for name in HEARD)
        say_that_it_listens(session)
        while True:
            envelope = session.receive(None)
            if envelope:
                handle(session, envelope, frames, driver, flags.verbose)


if __name__ == "__main__":
    sys.exit(main())
