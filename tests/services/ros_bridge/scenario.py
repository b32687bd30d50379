"""A test's side of the bridge in a network of its own: bus, shared memory, bridge and ROS nodes, for some seconds.

``scenario.py`` gets a scenario as JSON and prints what came of it; ``played`` runs it in new namespaces.
"""

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from dodo_dsl.opendlv.ros_messages import Types
from dodo_dsl.opendlv.ros_types import NODE_ENVIRONMENT, STATIC_FRAMES, STATIC_FRAMES_TYPE, RosGraph
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory
from services.ros_bridge.graph import Endpoint, Graph, taken, write

ROOT = Path(__file__).parents[3]
PYTHON = Path(os.environ.get("DODO_ROS_PYTHON") or ROOT / "build/ros/bin/python")
NAMESPACES = ["unshare", *(["-U", "-r"] if os.getuid() else []), "-n", "-i", "-p", "-f", "--mount-proc", "--kill-child"]
NETWORK = "ip link set lo up && ip route add 224.0.0.0/4 dev lo src 127.0.0.1"
PATIENCE_S = 60.0
CID = 111
WIDTH, HEIGHT = 64, 48


class Scenario(msgspec.Struct, kw_only=True):
    """``peers`` are nodes with their endpoints; ``messages`` go to the bus again and again, with pictures."""

    graph: RosGraph
    peers: dict[str, list[dict[str, Any]]] = {}
    messages: list[tuple[str, int, dict[str, Any]]] = []
    size: tuple[int, int] = (WIDTH, HEIGHT)
    seconds: float = 4.0
    environment: dict[str, str] | None = None
    raw: list[tuple[str, str, str, int]] = []
    """Topic, type, bytes (hex) and how often they are sent after half of the time, at once, by a stranger."""
    loses_memory: bool = False


class Played(msgspec.Struct, kw_only=True):
    """``heard`` are lines of the peers; ``sent`` messages of the bus: name, stamp, age in us, fields."""

    heard: list[dict[str, Any]]
    sent: list[tuple[str, int, int, str]]
    findings: list[tuple[str, str]]
    code: int
    log: str
    pictures: int
    frames: list[str]
    """The children of /tf_static."""


def refusal() -> str:
    """Why these tests cannot run here; empty when they can."""
    if not PYTHON.exists():
        return f"needs ROS 2: there is no {PYTHON}; DODO_ROS_PYTHON names a Python with rclpy"
    for words in ([str(PYTHON), "-c", "import rclpy, nav_msgs.msg"], [*NAMESPACES, "sh", "-c", NETWORK]):
        done = subprocess.run(words, check=False, capture_output=True, timeout=PATIENCE_S)
        if done.returncode:
            return f"needs ROS 2 and namespaces: {done.stderr.decode()[-200:]}"
    return ""


def played(scenario: Scenario) -> Played:
    shell = [*NAMESPACES, "sh", "-c", f'{NETWORK} && exec "$@"', "sh", sys.executable, __file__]
    given: dict[str, Any] = {"input": msgspec.json.encode(scenario), "env": {**os.environ, "PYTHONPATH": str(ROOT)}}
    done = subprocess.run(shell, capture_output=True, timeout=PATIENCE_S + scenario.seconds, check=False, **given)
    assert done.returncode == 0, done.stderr.decode()
    return msgspec.json.decode(done.stdout, type=Played)


def _main(scenario: Scenario) -> Played:
    name = f"dodo-ros-{os.getpid()}-{time.time_ns()}.bgr"
    width, height = scenario.size
    with (
        Session(CID) as session,
        SharedMemory.create(name, width * height * 3) as memory,
        tempfile.TemporaryDirectory() as folder,
    ):
        places = {who: Path(folder) / who for who in ("bridge", "log", *scenario.peers)}
        graph = msgspec.json.encode(scenario.graph).decode()
        names = [f"--name={name}"] if "MEMORY" in graph else []
        words = [sys.executable, "-m", "services.ros_bridge", f"--cid={CID}", f"--topics={graph}", *names]
        with places["bridge"].open("w") as out, places["log"].open("w") as log:
            words = [word.replace("MEMORY", name) for word in words]
            bridge = subprocess.Popen(words, cwd=ROOT, stdout=out, stderr=log)
        peers = {
            who: subprocess.Popen(
                [PYTHON, Path(__file__).with_name("peer.py"), who, json.dumps(endpoints)],
                stdout=places[who].open("w"),
                env={**os.environ, "PYTHONPATH": "", **(NODE_ENVIRONMENT if scenario.environment is None else {})},
            )
            for who, endpoints in scenario.peers.items()
        }
        sent: list[tuple[str, int, int, str]] = []
        threading.Thread(target=_listen, args=(sent,), daemon=True).start()
        _await(lambda: all(places[who].stat().st_size for who in peers))
        pictures, begin, is_over = 0, time.monotonic(), False
        while time.monotonic() - begin < scenario.seconds and bridge.poll() is None:
            if not is_over and time.monotonic() - begin > scenario.seconds / 2:
                is_over = True
                _shout(scenario.raw, Graph(Types()))
                if scenario.loses_memory:
                    memory.close()
                    names = []
            now = time.time_ns() // 1000
            for full_name, stamp, fields in scenario.messages:
                values = {key: bytes.fromhex(v) if isinstance(v, str) else v for key, v in fields.items()}
                session.send(session.messages.type(full_name)(**values), now, stamp)
            if names:
                with memory.lock():
                    memory.buffer[:] = bytes([pictures % 256]) * len(memory.buffer)
                    memory.stamp(now)
                    memory.notify_all()
                pictures += 1
            time.sleep(0.05)
        frames = _frames(Graph(Types())) if scenario.graph.frames else []
        bridge.terminate()
        code = bridge.wait(PATIENCE_S)
        for peer in peers.values():
            peer.kill()
        lines = [json.loads(line) for line in places["bridge"].read_text().splitlines()]
        return Played(
            heard=[json.loads(line) for who in peers for line in places[who].read_text().splitlines()[1:]],
            sent=sent,
            findings=[(line["severity"], line["finding"]) for line in lines],
            code=code,
            log=places["log"].read_text(),
            pictures=pictures,
            frames=frames,
        )


def _shout(raw: list[tuple[str, str, str, int]], joined: Graph) -> None:
    """Bytes on topics, whatever they are."""
    for topic, type_, data, often in raw:
        writer = joined.writer(Endpoint(b"", topic, type_, True), 1000)
        _await(writer.get_matched_subscriptions)
        for _ in range(often):
            write(writer, bytes.fromhex(data))
        time.sleep(0.5)


def _frames(joined: Graph) -> list[str]:
    """What somebody who comes late hears on /tf_static."""
    reader = joined.reader(Endpoint(b"", STATIC_FRAMES, STATIC_FRAMES_TYPE, False, durable=True), 1)
    found = Types().decode(STATIC_FRAMES_TYPE, _await(lambda: taken(reader))[0])
    return [each["child_frame_id"] for each in found["transforms"]]


def _await(what: Callable[[], Any]) -> Any:
    end = time.monotonic() + PATIENCE_S / 3
    while not (found := what()) and time.monotonic() < end:
        time.sleep(0.05)
    return found


def _listen(sent: list[tuple[str, int, int, str]]) -> None:
    """What the bridge says on the bus, beside the first session's own messages."""
    with Session(CID) as session:
        while True:
            envelope = session.receive(None)
            if envelope is not None:
                fields = str(session.messages.decode(envelope.data_type, envelope.payload)).replace("\n", " ").strip()
                name = session.messages.name(envelope.data_type)
                sent.append((name, envelope.sender_stamp, envelope.sent - envelope.sample_time, fields))


if __name__ == "__main__":
    print(msgspec.json.encode(_main(msgspec.json.decode(sys.stdin.buffer.read(), type=Scenario))).decode())
