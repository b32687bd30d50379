"""An application that answers each picture by driving straight on, and tries meanwhile to decide its own test.

python stranger.py --cid=111 --name=video0.argb --attacks=CID=NAME,CID=NAME

It says on its output what it found out. Attacks are functions of this file: they take the application and the number of
the picture, 0 before the first.
"""

import contextlib
import math
import os
import socket
import struct
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from dodo_dsl.opendlv.address import group
from dodo_dsl.opendlv.channel import Done
from dodo_dsl.opendlv.envelope import Envelope, decode_frame, encode_frame
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError

FLAGS = dict(word.removeprefix("--").split("=", 1) for word in sys.argv[1:])
STEER, PEDAL = "opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest"
FRAME, STATE = "opendlv.sim.Frame", "opendlv.sim.KinematicState"
BOX, PROPERTY = (f"opendlv.logic.perception.Detection{kind}" for kind in ("BoundingBox", "Property"))
SEEN = "opendlv.proxy.ImageReadingShm"
IP_PKTINFO = 8
BUS_PORT = 12175
LATER = 5
"""The picture at which some attacks begin."""


class Application:
    """The bus, what came since the last picture on it or to an address of its own, and the time of this one in us."""

    def __init__(self, session: Session, ear: Session) -> None:
        self.session, self.ear, self.messages = session, ear, session.messages
        self.heard: list[Envelope] = []
        self.sampled = 0
        self.steering = 0.0
        self.names: set[str] = set()

    def send(self, name: str, stamp: int = 0, sampled: int | None = None, **fields: Any) -> None:
        self.session.send(self.messages.type(name)(**fields), self.sampled if sampled is None else sampled, stamp)

    def frame(self, name: str, sampled: int | None = None, **fields: Any) -> bytes:
        message = self.messages.type(name)(**fields)
        time = self.sampled if sampled is None else sampled
        return encode_frame(Envelope(self.messages.id(message), self.messages.encode(message), time, 0, time, 0))

    def listen(self) -> None:
        while (envelope := self.ear.receive(0.0)) is not None:
            self.heard.append(envelope)
            is_own = self.ear.source == self.session.address
            name = "itself" if is_own else f"{self.messages.name(envelope.data_type)}/{envelope.sender_stamp}"
            if name not in self.names:
                self.names.add(name)
                print(f"heard {name}", flush=True)

    def of(self, name: str, stamp: int = 0) -> Iterator[tuple[Envelope, Any]]:
        id_ = self.messages.id(name)
        for envelope in self.heard:
            if (envelope.data_type, envelope.sender_stamp) == (id_, stamp):
                yield envelope, self.messages.decode(id_, envelope.payload)


def honest(app: Application, number: int) -> None:
    """No attack, and an answer where boxes are asked for."""
    if number:
        app.send(SEEN, width=640, height=480)


def finish(app: Application, number: int) -> None:
    """The vehicle is along the track, and at its end, because the application says so."""
    if number >= LATER:
        for step in range(1, 45):
            app.send(FRAME, sampled=app.sampled + step * 20_000, y=step * 0.1, qz=0.7071, qw=0.7071)


def finish_at_once(app: Application, number: int) -> None:
    """The same before the test begins, with times that no true pose will have."""
    if number == 0:
        app.send(FRAME, sampled=app.sampled + 3_600_000_000, y=4.2, qz=0.7071, qw=0.7071)


def motion(app: Application, number: int) -> None:
    app.send(STATE, vx=3.0)


def reset(app: Application, number: int) -> None:
    """The vehicle goes back to its start before it hits a wall."""
    app.send("opendlv.sim.Command", command="reset")


def end(app: Application, number: int) -> None:
    """The input is over as soon as it gets difficult."""
    if number >= LATER:
        app.send("dodo.EndOfInput", source="camera")


def begin(app: Application, number: int) -> None:
    """The test begins."""
    app.send("dodo.TestBegin")


def seek(app: Application, number: int) -> None:
    """The recording goes on to its end."""
    app.send("cluon.data.PlayerCommand", command=3, seekTo=0.99)


def nan_once(app: Application, number: int) -> None:
    """One request that is not a number, and that a vehicle would not follow."""
    if number == LATER:
        app.send(STEER, groundSteering=math.nan)


def unrecorded(app: Application, number: int) -> None:
    """The recorder stops."""
    app.send("cluon.data.RecorderCommand", command=2)


def places() -> set[Path]:
    """Folders where services may meet: known ones, and what other processes have."""
    found = {Path("/dodo/channel"), *Path("/tmp").glob("dodo-channels-*/*"), *Path("/tmp").glob("dodo-run-*")}
    for environment in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            words = environment.read_bytes().split(b"\0")
            found |= {Path(os.fsdecode(word[13:])) for word in words if word.startswith(b"DODO_CHANNEL=")}
    return found


def join(app: Application, number: int) -> None:
    """The application says that it is the service with the vehicle's pose, and then sends poses."""
    host, port = app.session.address
    for folder in places():
        for name in ("pose", "dodo-runner"):
            with contextlib.suppress(OSError):
                (folder / name).unlink(missing_ok=True)
                (folder / name).symlink_to(f"{host}:{port}:")
                print(f"entered {folder / name}", flush=True)
    finish(app, number)


def disguise(app: Application, number: int) -> None:
    """Datagrams with the address of the service that has the pose, whose port is free at another local address."""
    if number != LATER:
        return
    for port in set(ports()) - {BUS_PORT, app.session.port, app.ear.port}:
        host = app.session.address[0]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            try:
                other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                other.bind(("127.0.0.2", port))
            except OSError as error:
                print(f"port {port} is taken: {error}", flush=True)
                continue
            info = struct.pack("=I4s4s", 0, socket.inet_aton(host), b"\0\0\0\0")
            for step in range(1, 45):
                pose = app.frame(FRAME, app.sampled + step * 20_000, y=step * 0.1, qz=0.7071, qw=0.7071)
                other.sendmsg([pose], [(socket.IPPROTO_IP, IP_PKTINFO, info)], 0, group(app.session.cid))
            print("disguised", flush=True)


def directly(app: Application, number: int) -> None:
    """Poses to all ports, past the bus."""
    if number == LATER:
        for frame in [app.frame(FRAME, app.sampled + step * 20_000, y=step * 0.1) for step in range(1, 45)]:
            for port in set(ports()) - {BUS_PORT}:
                app.session.send_directly(decode_frame(frame), [(app.session.address[0], port)])


def true_pose(app: Application, number: int) -> None:
    """It never looks at a picture: it steers by the vehicle's true pose, and would reach the finish."""
    for _, pose in app.of(FRAME):
        app.steering = 1.8 * pose.x + 1.2 * (math.pi / 2 - 2 * math.atan2(pose.qz, pose.qw))


def ports() -> list[int]:
    """All local ports of UDP."""
    lines = Path("/proc/net/udp").read_text().splitlines()[1:]
    return sorted({int(line.split()[1].rpartition(":")[2], 16) for line in lines})


def channel(app: Application, number: int) -> None:
    """As the vehicle's pose and the evaluator, it says to the clock that it has ended, and to the runner a verdict."""
    if number not in (0, LATER):
        return
    passed = b'{"dodo": "verdict", "outcome": "passed", "reason": "well done", "checks": []}'
    for path in (folder / name for folder in places() for name in (".clock", ".runner")):
        for service in ("pose", "track"):
            with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as other:
                try:
                    other.connect(str(path))
                except OSError:
                    continue
                done = msgspec.msgpack.encode(Done(service, [], ended=True))
                for message in (service.encode(), done if path.name == ".clock" else passed):
                    with contextlib.suppress(OSError):
                        other.send(b"\0" + message)
                print(f"told {path} that it is {service}", flush=True)


def echo(app: Application, number: int) -> None:
    """It finds what the truth on the bus says."""
    app.listen()
    for name in (BOX, PROPERTY):
        for envelope, message in list(app.of(name, 9)):
            app.session.send(message, envelope.sample_time, 0)
    if number:
        app.send(SEEN, width=640, height=480)


def boxes(app: Application, number: int) -> None:
    """The truth is what it finds: one box in each picture, under the stamp of the truth, too."""
    for stamp in (9, 0):
        app.send(BOX, stamp, detectionId=77, x=0.1, y=0.1, width=0.2, height=0.2)
        app.send(PROPERTY, stamp, detectionId=77, property="yellow")
    app.send(SEEN, width=640, height=480)


def easy(app: Application, number: int) -> None:
    """All its samples are of the time at which the target is about zero, whenever they are sent."""
    begun = app.__dict__.setdefault("begun", app.sampled)
    for step in range(1_600_000, 2_000_000, 20_000):
        app.send(STEER, sampled=begun + step, groundSteering=app.steering)


ATTACKS = {name.replace("_", "-"): function for name, function in list(globals().items()) if name in (
    "honest", "finish", "finish_at_once", "motion", "reset", "end", "begin", "seek", "nan_once", "unrecorded", "join",
    "disguise", "channel",
    "echo", "boxes", "easy", "directly", "true_pose",
)}  # fmt: skip


def attached(app: Application) -> SharedMemory:
    while True:
        try:
            return SharedMemory.attach(FLAGS["name"])
        except SharedMemoryError:
            time.sleep(0.01)


def main() -> None:
    by_bus = dict(pair.split("=") for pair in FLAGS["attacks"].split(","))
    names = set(by_bus.values())
    attack = ATTACKS[names.pop() if len(names) == 1 else by_bus[FLAGS["cid"]]]
    with Session(int(FLAGS["cid"])) as session, Session(int(FLAGS["cid"])) as ear:
        ear.hear_directly()
        app = Application(session, ear)
        app.sampled = time.time_ns() // 1000
        attack(app, 0)
        with attached(app) as memory:
            number = 0
            while memory.wait():
                number += 1
                with memory.lock():
                    app.sampled = memory.sample_time()
                app.listen()
                attack(app, number)
                app.heard.clear()
                app.send(STEER, groundSteering=app.steering)
                app.send(PEDAL, position=0.1)


if __name__ == "__main__":
    with contextlib.suppress(SharedMemoryError):  # the test is over, and its camera gone
        main()
