"""Drive by what train.py has learned: one GroundSteeringRequest and one PedalPositionRequest for each frame.

python driver.py --cid=111 --name=video0.argb --width=640 --height=480 --model=model.npz
"""

import argparse
import contextlib
import signal
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from view import view

from dodo_dsl.opendlv import Session, SharedMemory, SharedMemoryError

LIMIT = 0.290888  # rad
PEDAL = 0.08
PATIENCE = 0.02  # seconds between looks for the camera


def drive(memory: SharedMemory, session: Session, weights: NDArray[np.float64], shape: tuple[int, int]) -> None:
    """Answers each frame; raises SharedMemoryError when the camera is gone."""
    steer = session.messages.type("opendlv.proxy.GroundSteeringRequest")
    press = session.messages.type("opendlv.proxy.PedalPositionRequest")
    pixels = np.frombuffer(memory.buffer, np.uint8).reshape(*shape, 4)
    while True:
        if not memory.wait():
            continue
        with memory.lock():
            picture, sample_time = pixels.copy(), memory.sample_time()
        angle = float(np.clip(view(picture) @ weights, -LIMIT, LIMIT))
        session.send(steer(groundSteering=angle), sample_time)
        session.send(press(position=PEDAL), sample_time)


def main() -> int:
    parser = argparse.ArgumentParser(description="Drive by a learned model.")
    parser.add_argument("--cid", type=int, required=True, help="the bus, 1 to 254")
    parser.add_argument("--name", default="video0.argb", help="the camera's shared memory")
    parser.add_argument("--width", type=int, required=True, help="of the image, in pixels")
    parser.add_argument("--height", type=int, required=True)
    parser.add_argument("--model", type=Path, required=True, help="file of train.py")
    flags = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    if not flags.model.is_file():
        print(f"driver: '{flags.model}' is missing: train.py writes it", file=sys.stderr)
        return 2
    with np.load(flags.model, allow_pickle=False) as model:
        weights = model["weights"]
    with Session(flags.cid) as session:
        while True:
            with contextlib.suppress(SharedMemoryError), SharedMemory.attach(flags.name) as memory:
                drive(memory, session, weights, (flags.height, flags.width))
            time.sleep(PATIENCE)


if __name__ == "__main__":
    sys.exit(main())
