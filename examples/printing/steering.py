"""Print how to steer for each frame, `group_06;<sample time in us>;<steering in rad>`, as many teams' programs do.

    python steering.py --cid=111 --name=video0.argb --width=640 --height=480

With `--bus` the answer goes to the bus instead.
"""

import argparse

import numpy as np

from dodo_dsl.opendlv import Session, SharedMemory, SharedMemoryError

parser = argparse.ArgumentParser()
parser.add_argument("--cid", type=int, required=True)
parser.add_argument("--name", default="video0.argb")
parser.add_argument("--width", type=int, required=True)
parser.add_argument("--height", type=int, required=True)
parser.add_argument("--bus", action="store_true")
flags = parser.parse_args()


def brightness(image: np.ndarray) -> int:
    """Of blue, green and red of each hundredth pixel, added up."""
    return int(image.reshape(-1, 4)[::100, :3].sum(dtype=np.int64))


with SharedMemory.attach(flags.name) as memory, Session(flags.cid) as session:
    request = session.messages.type("opendlv.proxy.GroundSteeringRequest")
    pixels = np.frombuffer(memory.buffer, np.uint8).reshape(flags.height, flags.width, 4)
    half = flags.width // 2
    try:
        while memory.wait():
            with memory.lock():
                left, right, sampled = brightness(pixels[:, :half]), brightness(pixels[:, half:]), memory.sample_time()
            steering = (left - right) / max(left + right, 1)  # to the brighter side
            if flags.bus:
                session.send(request(groundSteering=steering), sampled)
            else:
                print(f"group_06;{sampled};{steering!r}")
    except SharedMemoryError:
        pass  # the camera has ended
