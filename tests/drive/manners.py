"""An application that steers by the brightness of what it sees, with the manners of many.

python manners.py --cid=111 --name=video0.argb --manner=copies           one manner, or several with commas

copies        answers each picture once, with its sample time
own-times     the same with sample times of its own
twice         says everything twice, the second time something else
slow          takes its time every tenth picture
leaks         keeps 20 MB of each picture
restarts      replaces itself with a new process every twentieth picture
stops         answers no more after ten pictures, and goes on looking
timer         answers 100 times a second, or each --period s, whatever it saw last
"""

import hashlib
import os
import sys
import threading
import time

from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError

FLAGS = dict(word.removeprefix("--").split("=", 1) for word in sys.argv[1:])
MANNERS = FLAGS["manner"].split(",")
KEPT: list[bytearray] = []
SEEN: list[tuple[int, float]] = []
REQUESTS = ("opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest")


def attached() -> SharedMemory:
    while True:
        try:
            return SharedMemory.attach(FLAGS["name"])
        except SharedMemoryError:
            time.sleep(0.05)


def say(session: Session, sampled: int, share: float, more: float = 0.0) -> None:
    steer, pedal = (session.messages.type(name) for name in REQUESTS)
    stamp = None if "own-times" in MANNERS else sampled
    session.send(steer(groundSteering=0.03 * (share - 0.5) + more), stamp)
    session.send(pedal(position=0.1 + more), stamp)


def answer(session: Session, memory: SharedMemory, number: int) -> None:
    with memory.lock():
        picture, sampled = bytes(memory.buffer), memory.sample_time()
    digest = hashlib.sha256(picture).digest()
    print(f"picture {sampled} {digest.hex()}", flush=True)
    if "slow" in MANNERS and number % 10 == 0:
        time.sleep(0.3)
    if "leaks" in MANNERS:
        KEPT.append(bytearray(digest) * (20_000_000 // len(digest)))
    if "stops" in MANNERS and number >= 10:
        return
    share = picture[2_000_000 % len(picture) :: 4001].count(picture[-4]) / max(1, len(picture) // 4001)
    if "timer" in MANNERS:
        SEEN[:] = [(sampled, share)]
        return
    say(session, sampled, share)
    if "twice" in MANNERS:
        say(session, sampled, share, 0.05)
    if "restarts" in MANNERS and number % 20 == 19:
        os.execv(sys.executable, [sys.executable, *sys.argv])


def tick(session: Session) -> None:
    while True:
        time.sleep(float(FLAGS.get("period", "0.01")))
        for sampled, share in SEEN:
            say(session, sampled, share)


def main() -> None:
    with Session(int(FLAGS["cid"])) as session, attached() as memory:
        number = 0
        if "timer" in MANNERS:
            threading.Thread(target=tick, args=(session,), daemon=True).start()
        while memory.wait():
            answer(session, memory, number)
            number += 1


main()
