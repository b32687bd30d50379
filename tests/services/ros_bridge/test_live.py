"""The bridge with real ROS 2 nodes: every type both ways, the time, and what goes wrong, said in one line each."""

import re
import struct
from pathlib import Path
from typing import Any

import msgspec
import pytest

from dodo_dsl.opendlv.ros_types import (
    GIVEN,
    MOTION_REQUEST,
    POSE_ESTIMATE,
    CameraView,
    RosGraph,
    StaticFrame,
    Topic,
)
from tests.services.ros_bridge.scenario import HEIGHT, WIDTH, Played, Scenario, played, refusal

_WHY_NOT = refusal()
pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.skipif(bool(_WHY_NOT), reason=_WHY_NOT)]
CAMERA = CameraView(width=WIDTH, height=HEIGHT, fovy=48.8)
LIMIT = Path("/proc/sys/net/core/rmem_max")
IMAGE, TWIST, POSE = "sensor_msgs/msg/Image", "geometry_msgs/msg/Twist", "geometry_msgs/msg/PoseStamped"
SCAN, STAMPED = "sensor_msgs/msg/LaserScan", "geometry_msgs/msg/TwistStamped"


def topic(name: str, type_: str, *bus: str, **rest: object) -> Topic:
    return Topic(topic=name, type=type_, bus=bus, **rest)  # type: ignore[arg-type]


def end(name: str, type_: str, **rest: object) -> dict[str, object]:
    return {"topic": name, "type": type_, **rest}


VX = {"linear.x": 0.5, "angular.z": 0.25}
MESSAGES: list[tuple[str, int, dict[str, Any]]] = [
    ("robot.PlanarScan", 0, {"angleMin": -0.5, "angleIncrement": 0.5, "ranges": struct.pack("<2f", 1.5, 2.5).hex()}),
    ("opendlv.proxy.DistanceReading", 2, {"distance": 1.5}),
    ("opendlv.proxy.DistanceReading", 3, {"distance": 9.0}),
    ("opendlv.proxy.AngularVelocityReading", 0, {"angularVelocityZ": 0.5}),
    ("opendlv.proxy.AccelerationReading", 0, {"accelerationZ": 9.75}),
    ("opendlv.logic.sensation.Geolocation", 0, {"latitude": 57.5, "longitude": 12.25, "altitude": 4.0}),
    ("robot.OdometryReading", 0, {"x": 1.0, "vx": 0.5}),
    ("opendlv.proxy.GroundSpeedReading", 0, {"groundSpeed": 0.75}),
]
BUS = {
    "sensor_msgs/msg/Range": ("opendlv.proxy.DistanceReading/2",),
    **{type_: ("MEMORY",) for type_, ways in GIVEN.items() if ways == (("memory",),)},
}
GRAPH = RosGraph(
    given=(
        *(
            topic(f"/in/{type_.rpartition('/')[2].lower()}", type_, *BUS.get(type_, ways[0]), camera=CAMERA)
            for type_, ways in GIVEN.items()
        ),
        topic("/in/speed", "std_msgs/msg/Float32", "opendlv.proxy.GroundSpeedReading"),
        topic("/in/slow", "std_msgs/msg/Float64", "opendlv.proxy.GroundSpeedReading", rate=2.0),
    ),
    sent=(
        topic("/cmd_vel", TWIST, MOTION_REQUEST),
        topic("/cmd_stamped", STAMPED, f"{MOTION_REQUEST}/1"),
        topic("/odom", "nav_msgs/msg/Odometry", POSE_ESTIMATE),
        topic("/pose", POSE, f"{POSE_ESTIMATE}/1"),
        topic("/pose_cov", "geometry_msgs/msg/PoseWithCovarianceStamped", f"{POSE_ESTIMATE}/2"),
        topic("/height", "std_msgs/msg/Float64", "opendlv.proxy.GroundSpeedReading/7"),
    ),
    frames=(StaticFrame(parent="base_link", child="laser", x=0.1),),
)
PEERS = {
    "simulated_lane": [
        *(end(each.topic, each.type) for each in GRAPH.given),
        end("/clock", "rosgraph_msgs/msg/Clock", reliable=False),
        end("/cmd_vel", TWIST, fields=VX, reliable=False),
    ],
    "estimator": [
        end("/cmd_stamped", STAMPED, age=0.01, fields={"twist.linear.x": 0.25}),
        end("/odom", "nav_msgs/msg/Odometry", age=0.01, fields={"pose.pose.position.x": 2.0}),
        end("/pose", POSE, age=0.01, fields={"pose.position.y": 3.0, "header.frame_id": "map"}),
        end("/pose_cov", "geometry_msgs/msg/PoseWithCovarianceStamped", age=0.01, fields={"pose.pose.position.z": 4.0}),
        end("/height", "std_msgs/msg/Float64", fields={"data": 5.0}),
    ],
}


@pytest.fixture(scope="module")
def well() -> Played:
    return played(Scenario(graph=GRAPH, peers=PEERS, messages=MESSAGES, seconds=6))


@pytest.mark.xdist_group("ros-bridge-well")
def test_gives_and_takes_every_type_and_finds_nothing(well: Played) -> None:
    heard = {line["topic"]: line["message"] for line in well.heard}
    assert heard.keys() == {each.topic for each in GRAPH.given} | {"/clock"}
    assert heard["/in/image"]["data"][0] == WIDTH * HEIGHT * 3
    assert heard["/in/camerainfo"]["k"][2] == (WIDTH - 1) / 2
    assert heard["/in/laserscan"]["ranges"] == [1.5, 2.5]
    assert heard["/in/range"]["range"] == 1.5
    assert heard["/in/imu"]["linear_acceleration"]["z"] == 9.75
    assert heard["/in/imu"]["angular_velocity"]["z"] == 0.5
    assert heard["/in/navsatfix"]["latitude"] == 57.5
    assert heard["/in/odometry"]["pose"]["pose"]["position"]["x"] == 1.0
    assert heard["/in/speed"]["data"] == 0.75
    sent = {(name, stamp): (age, fields) for name, stamp, age, fields in well.sent}
    assert sent[MOTION_REQUEST, 0][1].startswith("vx: 0.5 ")
    assert sent[MOTION_REQUEST, 0][0] < 5_000  # us, as it has no stamp
    assert sent[MOTION_REQUEST, 1][0] >= 10_000
    assert [sent[POSE_ESTIMATE, stamp][1].split(" q")[0] for stamp in range(3)] == [
        "x: 2 y: 0 z: 0",
        "x: 0 y: 3 z: 0",
        "x: 0 y: 0 z: 4",
    ]
    assert sent["opendlv.proxy.GroundSpeedReading", 7][1] == "groundSpeed: 5"
    assert well.frames == ["laser"]
    assert (well.findings, well.code, well.log) == ([], 0, "")


@pytest.mark.xdist_group("ros-bridge-well")
def test_gives_pictures_once_with_their_time_and_the_time_in_steps(well: Played) -> None:
    by_topic: dict[str, list[dict[str, float]]] = {}
    for line in well.heard:
        at = line["message"].get("clock") or line["message"].get("header", {}).get("stamp")
        by_topic.setdefault(line["topic"], []).append(at)
    images = [(each["sec"], each["nanosec"]) for each in by_topic["/in/image"]]
    assert 1 < len(images) == len(set(images)) <= well.pictures
    assert images == [(each["sec"], each["nanosec"]) for each in by_topic["/in/camerainfo"]]
    times = [each["sec"] * 10**9 + each["nanosec"] for each in by_topic["/clock"]]
    assert times == sorted(times)
    assert not [each for each in times if each % 10_000_000]
    assert len(by_topic["/in/slow"]) < len(by_topic["/in/speed"]) / 4


WRONG = RosGraph(
    given=(
        topic("/camera/image_raw", IMAGE, "MEMORY", camera=CAMERA),
        topic("/scan", SCAN, "robot.PlanarScan"),
        topic("/map_scan", SCAN, "robot.PlanarScan"),
        topic("/unused", SCAN, "robot.PlanarScan"),
    ),
    sent=(
        topic("/cmd_vel", TWIST, MOTION_REQUEST),
        topic("/cmd_two", TWIST, MOTION_REQUEST),
        topic("/cmd_type", TWIST, MOTION_REQUEST),
        topic("/cmd_quality", TWIST, MOTION_REQUEST, reliability="reliable"),
        topic("/frame", POSE, POSE_ESTIMATE),
        topic("/unstamped", POSE, POSE_ESTIMATE),
        topic("/old", POSE, POSE_ESTIMATE),
        topic("/nothing", TWIST, MOTION_REQUEST),
    ),
)
QX = {"pose.orientation.w": 1.0}
WRONG_PEERS = {
    "lane": [
        end("/image_raw", IMAGE),
        end("/scan", SCAN),
        end("/map_scan", SCAN, durable=True),
        end("/cmd_vel_raw", TWIST, fields=VX),
        end("/cmd_two", TWIST, fields=VX),
        end("/cmd_type", STAMPED, age=0.0, fields={}),
        end("/cmd_quality", TWIST, fields=VX, reliable=False),
    ],
    "teleop": [
        end("/cmd_two", TWIST, fields=VX),
        end("/frame", POSE, age=0.0, fields={**QX, "header.frame_id": "camera"}),
        end("/unstamped", POSE, fields=QX),
        end("/old", POSE, age=7200.0, fields=QX),
        end("/nothing", TWIST, fields={"linear.x": "nan"}),
    ],
}
SENTENCES = [
    "nobody listens to /camera/image_raw (sensor_msgs/msg/Image); 'lane' listens to /image_raw: "
    "remap it (--ros-args -r /image_raw:=/camera/image_raw)",
    "nobody publishes /cmd_vel (geometry_msgs/msg/Twist); 'lane' publishes /cmd_vel_raw: "
    "remap it (--ros-args -r /cmd_vel_raw:=/cmd_vel)",
    "nobody listens to /unused (sensor_msgs/msg/LaserScan)",
    "'lane' listens to /map_scan with durability transient_local, the test with volatile, so that they never meet: "
    "write 'qos: {durability: transient_local}' at the topic",
    "'lane' publishes /cmd_quality with reliability best_effort, the test with reliable, so that they never meet: "
    "write 'qos: {reliability: best_effort}' at the topic",
    "'lane' publishes /cmd_type as geometry_msgs/msg/TwistStamped, the test has geometry_msgs/msg/Twist: "
    "write one type in both ('ros: out')",
    "'lane' and 'teleop' publish on /cmd_two: the last message counts; let one publish",
    "/frame comes in frame 'camera'; expected 'map' (from 'teleop')",
    "/unstamped comes without a stamp; expected that of what it answers (header.stamp) (from 'teleop')",
    "the stamps of /old are 7200.N s behind the test's time: copy header.stamp of what it answers, "
    "or take the node's clock (from 'teleop')",
    "a message on /nothing is not taken: linear.x of /nothing is nan, "
    "which opendlv.proxy.GroundMotionRequest.vx (float) cannot be (from 'teleop')",
]


def test_names_what_goes_wrong() -> None:
    seen = played(Scenario(graph=WRONG, peers=WRONG_PEERS, messages=MESSAGES[:1], seconds=16))
    said = [re.sub(r"7200\.\d", "7200.N", sentence) for _, sentence in seen.findings]
    assert set(said) ^ set(SENTENCES) == set()
    assert seen.code == 0


@pytest.mark.proof
def test_counts_pictures_that_a_small_buffer_loses() -> None:
    graph = RosGraph(given=(topic("/camera", IMAGE, "MEMORY", camera=CameraView(width=640, height=480)),))
    peers = {"lane": [end("/camera", IMAGE, reliable=False)]}
    scenario = Scenario(graph=graph, peers=peers, size=(640, 480), seconds=8, environment={})
    small = played(scenario)
    roomy = played(msgspec.structs.replace(scenario, environment=None))
    assert "datagrams were lost: 'lane' hears /camera by best effort" in str(small.findings)
    assert "lost" not in str(roomy.findings) or int(LIMIT.read_text()) < 1_000_000


CDR = "00010000"


def test_a_strangers_bytes_and_floods_end_nothing() -> None:
    """Malformed, endless, not finite, too large, and 3,000 at once: each is a sentence at most."""
    raw = [
        ("/short", TWIST, CDR + "0102", 3),
        ("/random", POSE, CDR + "ff" * 100, 3),
        ("/nan", TWIST, CDR + struct.pack("<6d", *[float("nan")] * 6).hex(), 3),
        ("/large", TWIST, CDR + "00" * 2_000_000, 1),
        ("/flood", TWIST, CDR + struct.pack("<6d", 0.5, 0, 0, 0, 0, 0.25).hex(), 3000),
    ]
    bus = {TWIST: MOTION_REQUEST, POSE: POSE_ESTIMATE}
    graph = RosGraph(sent=tuple(topic(name, type_, bus[type_]) for name, type_, _, _ in raw))
    seen = played(Scenario(graph=graph, raw=raw, seconds=6))
    said = sorted(sentence.partition(": ")[0] for _, sentence in seen.findings)
    assert said == [f"a message on {name} is not taken" for name in ("/large", "/nan", "/random", "/short")]
    assert (seen.code, len(seen.log.splitlines())) == (0, len(said))
    assert 0 < len(seen.sent) <= 3000
    assert {fields for _, _, _, fields in seen.sent} == {"vx: 0.5 vy: 0 vz: 0 rollRate: 0 pitchRate: 0 yawRate: 0.25"}


@pytest.mark.proof
def test_ends_with_a_sentence_when_a_memory_is_lost() -> None:
    graph = RosGraph(given=(topic("/camera", IMAGE, "MEMORY", camera=CAMERA),))
    seen = played(Scenario(graph=graph, loses_memory=True, seconds=20))
    assert seen.code == 1
    assert seen.log.startswith("ros-bridge: shared memory ")
    assert seen.log.endswith("was removed by its creator\n")
