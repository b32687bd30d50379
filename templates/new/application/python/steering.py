import argparse

import numpy as np

from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.memory.shared_memory import SharedMemory

WIDTH, HEIGHT = 640, 480
parser = argparse.ArgumentParser()
parser.add_argument("--cid", type=int, required=True)
parser.add_argument("--name", default="video0.argb")
flags = parser.parse_args()


def middle(cones: np.ndarray, without: float) -> float:
    """Where the cones are: -0.5 is the left edge of the picture, 0.5 the right one."""
    return np.nonzero(cones)[1].mean() / WIDTH - 0.5 if cones.any() else without


with SharedMemory.attach(flags.name) as memory, Session(flags.cid) as session:
    steering = session.messages.type("opendlv.proxy.GroundSteeringRequest")
    pedal = session.messages.type("opendlv.proxy.PedalPositionRequest")
    pixels = np.frombuffer(memory.buffer, np.uint8).reshape(HEIGHT, WIDTH, 4)
    while memory.wait():  # the camera notifies of each frame
        with memory.lock():
            blue, green, red = (pixels[280:340, :, channel].astype(int) for channel in range(3))
            sampled = memory.sample_time()
        left, right = middle(green - blue > 80, -0.5), middle(blue - red > 80, 0.5)
        session.send(steering(groundSteering=-(left + right)), sampled)
        session.send(pedal(position=0.1), sampled)
