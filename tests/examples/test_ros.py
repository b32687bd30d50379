"""ROS 2 applications: real nodes on Fast DDS pass their tests in lockstep, the same way each time."""

import hashlib
import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import read_envelopes
from dodo_dsl.opendlv.ros_types import FRAME_IDS, GIVEN, SENT
from tests.examples.ros import NODES, PYTHON, ROOT, copy, dodo, needs_ros, run

ANSWERS = {
    "lane": "opendlv.proxy.GroundMotionRequest",
    "corridor": "opendlv.proxy.GroundSteeringRequest",
    "detector": "opendlv.logic.perception.DetectionBoundingBox",
}


def answers(folder: Path, test: str, message: str) -> tuple[int, str]:
    """How many the application gave, and a hash of their values and times since the first of all messages."""
    recorded = list(read_envelopes(folder / "report" / test / "test.rec"))
    began, id_ = min(one.sample_time for one in recorded), MessageSet.standard().id(message)
    own = [(one.sample_time - began, one.payload) for one in recorded if (one.data_type, one.sender_stamp) == (id_, 0)]
    return len(own), hashlib.sha256(repr(own).encode()).hexdigest()


@needs_ros
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "times"),
    [("lane", 2), ("corridor", 1), ("detector", 1), *(pytest.param(n, 20, marks=pytest.mark.proof) for n in NODES)],
)
def test_an_application_passes_its_test_the_same_way_each_time(name: str, times: int, tmp_path: Path) -> None:
    folder = copy(name, tmp_path)
    found = []
    for _ in range(times):
        test = run(folder)
        assert (test["outcome"], test["notes"]) == ("passed", []), test["reason"]
        found.append((json.dumps(test["checks"]), *answers(folder, f"sil-{name}", ANSWERS[name])))
    assert len(set(found)) == 1
    assert found[0][1] > 30


NEIGHBOUR = """
import rclpy
from geometry_msgs.msg import Twist
rclpy.init()
node, turn = rclpy.create_node("neighbour"), Twist()
turn.angular.z = 3.0
heard = node.create_subscription(Twist, "/cmd_vel", lambda twist: twist == turn or print(twist, flush=True), 10)
publisher = node.create_publisher(Twist, "/cmd_vel", 10)
node.create_timer(0.02, lambda: publisher.publish(turn))
print("ready", flush=True)
rclpy.spin(node)
"""


@needs_ros
@pytest.mark.slow
@pytest.mark.parametrize("at_once", [2, pytest.param(8, marks=pytest.mark.proof)])
def test_no_graph_hears_another_one(at_once: int, tmp_path: Path) -> None:
    """Tests at once, and a node on the host's network that steers on the same topic of the same domain."""
    folder = copy("lane", tmp_path)
    alone = run(folder)
    environment = {**os.environ, "ROS_DOMAIN_ID": "0"}
    words = [PYTHON, "-c", NEIGHBOUR]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment
    ) as neighbour:
        assert neighbour.stdout and neighbour.stdout.readline() == "ready\n"
        count = str(at_once)
        dodo(folder, "run", "--repeat", count, "-j", count, "--report", "report")
        neighbour.terminate()
        assert neighbour.stdout.read() == ""
    found = json.loads((folder / "report/results.json").read_text())["tests"]
    assert len(found) == at_once
    assert all((each["outcome"], each["checks"]) == ("passed", alone["checks"]) for each in found)


@needs_ros
@pytest.mark.slow
def test_a_topic_that_nobody_hears_is_the_reason(tmp_path: Path) -> None:
    folder = copy("lane", tmp_path)
    deployment = folder / "dodo.yml"
    deployment.write_text(deployment.read_text().replace("/camera/image_raw:", "/image:"))
    test = run(folder)
    remap = "'lane_follower' listens to /camera/image_raw: remap it (--ros-args -r /camera/image_raw:=/image)"
    assert test["outcome"] == "failed"
    assert test["reason"].startswith(f"nobody listens to /image (sensor_msgs/msg/Image); {remap}")


@pytest.mark.parametrize("name", NODES)
def test_nodes_know_nothing_of_dodo(name: str) -> None:
    """Neither they nor their compose files; what DoDo needs are a few lines of dodo.yml."""
    folder = ROOT / "examples" / "ros" / name
    for file in (folder / f"{NODES[name]}.py", folder / "docker-compose.yml"):
        assert "dodo" not in file.read_text().lower(), file


@pytest.mark.thorough
@pytest.mark.parametrize("name", NODES)
def test_their_tests_compile(name: str, tmp_path: Path) -> None:
    said = dodo(copy(name, tmp_path), "compile", "--check")
    assert "1 test checked" in said and "error" not in said, said


@pytest.mark.slow
def test_without_ros_the_result_says_what_is_missing(tmp_path: Path) -> None:
    folder = copy("lane", tmp_path)
    deployment = folder / "dodo.yml"
    deployment.write_text(deployment.read_text().replace(str(ROOT / "build/ros"), "../ros"))
    test = run(folder)
    assert test["outcome"] == "error" and "../ros/bin/python" in test["reason"], test["reason"]


@needs_ros
@pytest.mark.slow
def test_the_new_application_passes_its_first_test(tmp_path: Path) -> None:
    written = dodo(tmp_path, "new", "--application", "--ros")
    assert "next: PATH-OF-DODO'S-CHECKOUT/scripts/install-ros .ros" in written
    shutil.copytree(PYTHON.parents[1], tmp_path / ".ros", symlinks=True, copy_function=os.link)
    assert "1 test checked: no problems" in dodo(tmp_path, "compile", "--check")
    test = run(tmp_path)
    assert test["outcome"] == "passed", test["reason"]


PAGE = (ROOT / "docs/reference/ros2.md").read_text()


def test_the_page_has_every_type_with_its_frame() -> None:
    rows = {}
    for what, made, frame in re.findall(r"^\| (\w+: .+?) \| (.+?) \| (.+?) \|$", PAGE, re.MULTILINE):
        for package, names in re.findall(r"(\w+): ([^;]+)", what):
            rows |= {f"{package}/msg/{name.strip()}": (made, frame) for name in names.split(",")}
    assert rows.keys() == GIVEN.keys() | SENT.keys()
    for type_, messages in SENT.items():
        assert type_ in GIVEN or all(name.rpartition(".")[2] in rows[type_][0] for name in messages), type_
    assert all(f"`{frame}`" in rows[type_][1] for type_, frame in FRAME_IDS.items() if type_ not in SENT)


@pytest.mark.parametrize("page", ["docs/reference/ros2.md", "docs/tutorial/ros2.md"])
def test_mappings_of_pages_fit_the_schema(page: str) -> None:
    schema = Draft202012Validator(json.loads((ROOT / "schemas/application.schema.json").read_text()))
    blocks = re.findall(r"```yaml\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    written = [yaml.safe_load(block)["application"]["services"] for block in blocks]
    mappings = [service["ros"] for services in written for service in services.values()]
    assert mappings
    for mapping in mappings:
        schema.validate({"services": {"node": {"image": "node", "x-dodo": {"ros": mapping}}}})
