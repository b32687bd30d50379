"""An application that acts by its own time: a thread sees, the other one steers by a timer and a low-pass over time.

python timed.py --cid=111 --name=video0.argb [--from=PLACE]

It steers by where it sees the cones on the ground, 100 times a second, and presses the pedal 10 times a second. Both
messages have a time of their own, and some chance: a drive is another one where time or chance are.
"""

import math
import random
import sys
import threading
import time

import numpy as np

from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory

WIDTH, HEIGHT = 640, 480
PERIOD_S, CONSTANT_S = 0.01, 0.05
FLAGS = dict(word.removeprefix("--").split("=", 1) for word in sys.argv[1:])


class Eye:
    """Sees how far to the right of the middle the track is, as a share of the picture."""

    def __init__(self, memory: SharedMemory) -> None:
        self._memory = memory
        self._changed = threading.Condition()
        self.seen = 0.0

    def run(self) -> None:
        while self._memory.wait():
            with self._memory.lock():
                picture = np.frombuffer(self._memory.buffer, np.uint8).reshape(HEIGHT, WIDTH, 4)[280:340].astype(int)
            blue, green, red = picture[..., 0], picture[..., 1], picture[..., 2]
            left, right = (self._middle(green - blue > 80, -0.5), self._middle(blue - red > 20, 0.5))
            with self._changed:
                self.seen = left + right
                self._changed.notify_all()

    @staticmethod
    def _middle(is_cone: np.ndarray, without: float) -> float:
        columns = np.nonzero(is_cone)[1]
        return float(columns.mean()) / WIDTH - 0.5 if columns.size else without

    def wait(self) -> None:
        """Until it has seen a picture."""
        with self._changed:
            self._changed.wait_for(lambda: self.seen != 0.0, timeout=20.0)


def main() -> None:
    with Session(int(FLAGS["cid"])) as session, SharedMemory.attach(FLAGS["name"]) as memory:
        steer, pedal = (
            session.messages.type(f"opendlv.proxy.{name}") for name in ("GroundSteeringRequest", "PedalPositionRequest")
        )
        eye = Eye(memory)
        threading.Thread(target=eye.run, daemon=True).start()
        eye.wait()
        angle, before, number = 0.0, time.monotonic(), 0
        while True:
            time.sleep(PERIOD_S)
            now = time.monotonic()
            angle += (-eye.seen - angle) * (1 - math.exp(-(now - before) / CONSTANT_S))
            before = now
            session.send(steer(groundSteering=angle + random.uniform(-0.01, 0.01)))
            if number % 10 == 0:
                session.send(pedal(position=0.1))
            number += 1


main()
