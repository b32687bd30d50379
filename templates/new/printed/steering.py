import argparse

import numpy as np

from dodo_dsl.opendlv import SharedMemory

WIDTH, HEIGHT = 640, 480
parser = argparse.ArgumentParser()
parser.add_argument("--cid", type=int, help="the bus, on which it says nothing")
parser.add_argument("--name", default="video0.argb")
flags = parser.parse_args()


def middle(cones: np.ndarray, without: float) -> float:
    """Where the cones are: -0.5 is the left edge of the picture, 0.5 the right one."""
    return np.nonzero(cones)[1].mean() / WIDTH - 0.5 if cones.any() else without


with SharedMemory.attach(flags.name) as memory:
    pixels = np.frombuffer(memory.buffer, np.uint8).reshape(HEIGHT, WIDTH, 4)
    while memory.wait():  # the camera notifies of each frame
        with memory.lock():
            blue, green, red = (pixels[280:340, :, channel].astype(int) for channel in range(3))
            sampled = memory.sample_time()
        left, right = middle(green - blue > 80, -0.5), middle(blue - red > 20, 0.5)
        print(f"group_01;{sampled};{-(left + right):.6f};0.1")  # steering in rad, positive to the left, and pedal
