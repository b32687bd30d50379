"""An application that harms whom it can reach, and drives nobody.

It ends when there is a file /stop/now, or --stop, at the latest after ten minutes.

python3 hostile.py --cid=111 --name=video0.argb --harm=HARM[,HARM...] of flood, groups, memory and tmp
"""

import contextlib
import itertools
import os
import socket
import sys
import time
from pathlib import Path
from threading import Thread

import sysv_ipc

from dodo_dsl.opendlv.address import group
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet

FLAGS = dict(word.removeprefix("--").split("=", 1) for word in sys.argv[1:])
CID = int(FLAGS["cid"])
MESSAGES = MessageSet.standard()
LARGE = 40_000


def request(name: str, **fields: float) -> bytes:
    message = MESSAGES.type(name)(**fields)
    now = time.time_ns() // 1000
    return encode_frame(Envelope(MESSAGES.id(message), MESSAGES.encode(message), now, 0, now, 0))


def flood() -> None:
    """Some 15,000 datagrams a second, garbage and large ones, on the test's own bus.

    Later ones are small, so that the recording stays within its limit however slow the machine is.
    """
    junk, small = (encode_frame(Envelope(5000, os.urandom(size), 0, 0, 0, 0)) for size in (20_000, 200))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for turn in itertools.count():
            junk = junk if turn < LARGE else small
            sender.sendto(junk if turn % 2 else os.urandom(100), group(CID))
            if turn % 200 == 0:
                time.sleep(0.01)


def groups() -> None:
    """Full steering and pedal on every other test's group."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        while True:
            steering = request("opendlv.proxy.GroundSteeringRequest", groundSteering=-0.29)
            pedal = request("opendlv.proxy.PedalPositionRequest", position=-0.9)
            frame = request("opendlv.sim.Frame", x=100.0, qw=1.0)
            for cid in range(1, 255):
                if cid != CID:
                    for datagram in (steering, pedal, frame):
                        sender.sendto(datagram, group(cid))
            time.sleep(0.05)


def memory() -> None:
    """Zeros into all shared memory in sight, token files of the usual names made anew."""
    while True:
        for name in ("video1.argb", "video1.i420", "img.argb", "img.i420"):
            token = Path("/tmp", name)
            token.touch()
            key = sysv_ipc.ftok(str(token), 1, True)
            sysv_ipc.SharedMemory(key, sysv_ipc.IPC_CREAT, size=640 * 480 * 4)
        for line in Path("/proc/sysvipc/shm").read_text().splitlines()[1:]:
            segment = sysv_ipc.SharedMemory(int(line.split()[0]))
            segment.write(b"\0" * segment.size)
            segment.detach()
        time.sleep(0.02)


def tmp() -> None:
    """Writes into /tmp until it is full, and keeps it so."""
    junk = os.urandom(1 << 20)
    for number in itertools.count():
        with contextlib.suppress(OSError):
            Path(f"/tmp/filler-{number % 1000}").write_bytes(junk)
        time.sleep(0.01 if number < 1000 else 0.1)


print(f"hostile: {FLAGS['harm']}", flush=True)
harms = {"flood": flood, "groups": groups, "memory": memory, "tmp": tmp}
threads = [Thread(target=harms[name], daemon=True) for name in FLAGS["harm"].split(",")]
for thread in threads:
    thread.start()
end = time.monotonic() + 600
stop = Path(FLAGS.get("stop", "/stop/now"))
while not stop.exists() and all(map(Thread.is_alive, threads)) and time.monotonic() < end:
    time.sleep(0.1)
sys.exit(0 if all(map(Thread.is_alive, threads)) else 1)
