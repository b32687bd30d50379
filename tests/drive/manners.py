"""An application that steers by the brightness of what it sees, with the manners of many.

python manners.py --cid=111 --name=video0.argb --manner=copies           one manner, or several with commas

copies        answers each picture once, with its sample time
own-times     the same with sample times of its own
leaks         keeps 20 MB of each picture
restarts      replaces itself with a new process every twentieth picture
stops         answers no more after ten pictures, and goes on looking
"""

import hashlib
import os
import sys
import time

from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError

FLAGS = dict(word.removeprefix("--").split("=", 1) for word in sys.argv[1:])
MANNERS = FLAGS["manner"].split(",")
KEPT: list[bytearray] = []
REQUESTS = ("opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest")


def attached() -> SharedMemory:
    while True:
        try:
            return SharedMemory.attach(FLAGS["name"])
        except SharedMemoryError:
            time.sleep(0.05)


def say(session: Session, sampled: int, share: float) -> None:
    steer, pedal = (session.messages.type(name) for name in REQUESTS)
    stamp = None if "own-times" in MANNERS else sampled
    session.send(steer(groundSteering=0.03 * (share - 0.5)), stamp)
    session.send(pedal(position=0.1), stamp)


def answer(session: Session, memory: SharedMemory, number: int) -> None:
    with memory.lock():
        picture, sampled = bytes(memory.buffer), memory.sample_time()
    digest = hashlib.sha256(picture).digest()
    print(f"picture {sampled} {digest.hex()}", flush=True)
    if "leaks" in MANNERS:
        KEPT.append(bytearray(digest) * (20_000_000 // len(digest)))
    if "stops" in MANNERS and number >= 10:
        return
    share = picture[2_000_000 % len(picture) :: 4001].count(picture[-4]) / max(1, len(picture) // 4001)
    say(session, sampled, share)
    if "restarts" in MANNERS and number % 20 == 19:
        os.execv(sys.executable, [sys.executable, *sys.argv])


def main() -> None:
    with Session(int(FLAGS["cid"])) as session, attached() as memory:
        number = 0
        while memory.wait():
            answer(session, memory, number)
            number += 1


main()
