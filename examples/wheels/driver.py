"""Drive between two white lines with two wheels: a PedalPositionRequest for each of them, 0 left and 1 right.

    python driver.py --cid=111 --name=video0.argb --width=320 --height=240

Answers each frame by two requests with its sample time. `--swap` gives each wheel the other one's pedal, for those
who want to see a test fail.
"""

import argparse
import contextlib
import signal
import sys
import time

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv import Session, SharedMemory, SharedMemoryError

WHITE = 200
ROWS = (0.62, 0.75)  # of the frame's height, in which it looks for the lines
PEDAL = 0.5
GAIN = 0.4  # of pedal, where the lane's middle is at the frame's edge
PATIENCE = 0.02  # seconds between looks for the camera


def middle(picture: NDArray[np.uint8]) -> float:
    """Where the middle between the lines is: 1 at the left edge of the frame, -1 at the right one."""
    height, width, _ = picture.shape
    rows = picture[int(ROWS[0] * height) : int(ROWS[1] * height)]
    columns = np.nonzero(rows[..., :3].min(axis=2) > WHITE)[1]
    left, right = columns[columns < width // 2], columns[columns >= width // 2]
    from_left = left.mean() if len(left) else 0.0
    from_right = right.mean() if len(right) else width
    return float(1 - (from_left + from_right) / width)


def drive(memory: SharedMemory, session: Session, shape: tuple[int, int], sign: int) -> None:
    """Answers each frame; raises SharedMemoryError when the camera is gone."""
    press = session.messages.type("opendlv.proxy.PedalPositionRequest")
    pixels = np.frombuffer(memory.buffer, np.uint8).reshape(*shape, 4)
    while True:
        if not memory.wait():
            continue
        with memory.lock():
            picture, sample_time = pixels.copy(), memory.sample_time()
        turn = sign * GAIN * middle(picture)
        session.send(press(position=PEDAL - turn), sample_time, 0)
        session.send(press(position=PEDAL + turn), sample_time, 1)


def main() -> int:
    parser = argparse.ArgumentParser(description="Drive between two white lines with two wheels.")
    parser.add_argument("--cid", type=int, required=True, help="the bus, 1 to 254")
    parser.add_argument("--name", default="video0.argb", help="the camera's shared memory")
    parser.add_argument("--width", type=int, required=True, help="of the image, in pixels")
    parser.add_argument("--height", type=int, required=True)
    parser.add_argument("--swap", action="store_true", help="give each wheel the other one's pedal")
    flags = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    with Session(flags.cid) as session:
        while True:
            with contextlib.suppress(SharedMemoryError), SharedMemory.attach(flags.name) as memory:
                drive(memory, session, (flags.height, flags.width), -1 if flags.swap else 1)
            time.sleep(PATIENCE)


if __name__ == "__main__":
    sys.exit(main())
