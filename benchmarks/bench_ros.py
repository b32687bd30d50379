"""A picture of 640x480 to a ROS 2 node and its answer back: by DoDo's bridge, and by rclpy alone.

    python benchmarks/bench_ros.py

The node is the same. Ours go from shared memory to the node, and its Twist to the bus; theirs from one rclpy program to
the other, by shared memory as Fast DDS has it by default. The processor time is that of the bridge, and of the program
that sends. Then a drive of a shipped test. It needs a Python with rclpy, build/ros/bin/python or that in
DODO_ROS_PYTHON, and network namespaces.
"""

import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from players import ROOT, Measured, finished

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, attempt, cost_row, plan, report
from dodo_dsl.opendlv.ros_types import MOTION_REQUEST, NODE_ENVIRONMENT
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory

ROUNDS, COUNT = 9, 100
WIDTH, HEIGHT, CID = 640, 480, 121
PYTHON = Path(os.environ.get("DODO_ROS_PYTHON") or ROOT / "build/ros/bin/python")
PEER = "rclpy alone"
NETWORK = "ip link set lo up && ip route add 224.0.0.0/4 dev lo src 127.0.0.1"
NAMESPACES = ["unshare", *(["-U", "-r"] if os.getuid() else []), "-n", "-i", "-p", "-f", "--mount-proc", "--kill-child"]
NODE = Path(__file__).with_name("ros_node.py")
WHAT = "ROS 2, picture of 640x480 to answer"
PATIENCE_S = 20.0
Round = tuple[list[float], float]


def rows(ours: list[Round], theirs: list[Round]) -> list[Row]:
    """Medians and 99 % quantiles of the round trips, and the processor time a picture, by round."""
    own, other = ([statistics.median(times) for times, _ in each] for each in (ours, theirs))
    late, late_other = ([sorted(times)[len(times) * 99 // 100] for times, _ in each] for each in (ours, theirs))
    costs, other_costs = ([cost for _, cost in each] for each in (ours, theirs))
    return [
        cost_row(f"{WHAT}, median", "ms", own, PEER, other, goal=Goal(0.8)),
        cost_row(f"{WHAT}, 99 %", "ms", late, PEER, late_other),
        cost_row(f"{WHAT}, processor time of its sender", "ms", costs, PEER, other_costs),
    ]


def alone(role: str) -> Round:
    """A round in its own network."""
    words = [*NAMESPACES, "sh", "-c", f'{NETWORK} && exec "$@"', "sh", sys.executable, __file__, role]
    done = subprocess.run(words, check=True, capture_output=True, text=True, timeout=60)
    times, cost = json.loads(done.stdout.splitlines()[-1])
    return times, cost


TEST, APPLICATION = (
    "sil-closed-straight",
    """\
services:
  lane:
    image: team/lane
    x-dodo:
      ros:
        in: {/camera: {type: sensor_msgs/msg/Image, encoding: bgr8}}
        out: {/cmd_vel: geometry_msgs/msg/Twist}
    x-dodo-process: [v/bin/python, ros_node.py, drive]
""",
)


def drive_row(rounds: list[tuple[float, float]]) -> Row:
    """Seconds of a drive in lockstep, beside its own time."""
    own, test = ([each[number] for each in rounds] for number in (0, 1))
    return cost_row(f"ROS 2, {TEST} by Twist in lockstep", "s", own, "real time", test, goal=Goal(3))


def drives(budget: Budget) -> None:
    """The drive of a test, again and again, of an application beside a copy of the Python with rclpy."""
    with tempfile.TemporaryDirectory(dir=ROOT / "build") as name:
        folder = Path(name)
        shutil.copytree(PYTHON.parent.parent, folder / "v", symlinks=True, copy_function=os.link)
        shutil.copy(NODE, folder)
        (folder / "compose.yml").write_text(APPLICATION)
        (folder / "dodo.yml").write_text(f"dodo: 1\nregistry: [{ROOT / 'tests_registry'}]\napplication: compose.yml\n")
        words = [sys.executable, "-m", "dodo_dsl", "run", TEST, "--report", "report"]
        rounds: list[tuple[float, float]] = []
        for _ in budget.rounds(ROUNDS):
            if code := finished(words, folder):
                raise RuntimeError(f"{TEST} ended with {code}")
            (test,) = json.loads((folder / "report" / "results.json").read_text())["tests"]
            rounds.append((test["execution_s"], test["sim_s"]))
            report(drive_row(rounds))
        alone, real = (statistics.median(column) for column in zip(*rounds, strict=True))
        print(
            f"{TEST}: {alone:.2f} s in lockstep, {real / alone:.1f} times real time, {60 / alone:.0f} drives a minute"
        )


def theirs() -> None:
    with subprocess.Popen([PYTHON, NODE, "node"]) as node:
        subprocess.run([PYTHON, NODE, "pictures", str(COUNT)], check=True)
        node.kill()


def ours() -> None:
    name = f"dodo-bench-{os.getpid()}.bgr"
    camera = {"width": WIDTH, "height": HEIGHT, "fovy": 48.8}
    image = {"topic": "/camera", "type": "sensor_msgs/msg/Image", "bus": [name], "camera": camera}
    twist = {"topic": "/cmd_vel", "type": "geometry_msgs/msg/Twist", "bus": [MOTION_REQUEST]}
    graph = json.dumps({"given": [image], "sent": [twist]})
    words = [sys.executable, "-m", "services.ros_bridge", f"--cid={CID}", f"--topics={graph}"]
    with Session(CID) as session, SharedMemory.create(name, WIDTH * HEIGHT * 3) as memory:
        bridge = subprocess.Popen(words, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)})
        node = subprocess.Popen([PYTHON, NODE, "node"], env={**NODE_ENVIRONMENT, **os.environ})
        measured, times, begin = Measured(bridge), [], 0.0
        until = time.monotonic() + PATIENCE_S
        while not memory.readers_waiting() and time.monotonic() < until:
            time.sleep(0.01)
        time.sleep(0.5)  # the node has met the bridge, too
        for number in range(-COUNT // 10, COUNT):
            if number == 0:
                begin = measured.processor_time()
            while session.receive(0.0):
                pass
            start = time.perf_counter()
            with memory.lock():
                memory.buffer[:] = bytes([number % 256]) * len(memory.buffer)
                memory.stamp(time.time_ns() // 1000)
                memory.notify_all()
            session.receive(1.0)
            times.append((time.perf_counter() - start) * 1000)
            until = time.monotonic() + 1.0
            while not memory.readers_waiting() and time.monotonic() < until:
                time.sleep(0.0005)
        cost = (measured.processor_time() - begin) / COUNT * 1000
        bridge.kill()
        node.kill()
    print(json.dumps([times[-COUNT:], cost]))


def refusal() -> str:
    """Why nothing can be measured here."""
    if not PYTHON.exists():
        return f"there is no {PYTHON.name} with rclpy (DODO_ROS_PYTHON)"
    for words in ([str(PYTHON), "-c", "import rclpy"], [*NAMESPACES, "sh", "-c", NETWORK]):
        if subprocess.run(words, check=False, capture_output=True, timeout=60).returncode:
            return f"'{words[0]}' does not work here with rclpy and namespaces"
    return ""


def main() -> int:
    budget = Budget.given()
    plan(*rows([], []), drive_row([]))
    if why_not := refusal():
        plan(*rows([], []), drive_row([]), note=why_not)
        print(f"not measured: {why_not}")
        return 0
    own: list[Round] = []
    other: list[Round] = []
    with attempt(*rows([], [])):
        for _ in budget.rounds(ROUNDS, until=0.6):
            own.append(alone("ours"))
            other.append(alone("theirs"))
            report(*rows(own, other))
    with attempt(drive_row([])):
        drives(budget)
    for row in rows(own, other) if own else ():
        print(f"{row.what}: {statistics.median(row.ours):.2f} ms, {PEER} {statistics.median(row.theirs):.2f} ms")
    return 0


if __name__ == "__main__":
    sys.exit({"ours": ours, "theirs": theirs}.get(sys.argv[-1], main)())
