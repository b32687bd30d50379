"""Bags of ROS 2, as rosbags reads and writes them, to recordings and back."""

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer

from dodo_dsl.opendlv.envelope import encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.ros_messages import Types
from tests.opendlv.ros.values import plain
from tests.rec.conftest import BEGIN, dodo_rec, message, video

TYPES, MESSAGES = Types(), MessageSet.standard()
STORAGES = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}
TOPICS = {
    "/camera/image_raw": "sensor_msgs/msg/Image",
    "/cmd_vel": "geometry_msgs/msg/Twist",
    "/detections": "vision_msgs/msg/Detection2DArray",
    "/drive": "ackermann_msgs/msg/AckermannDriveStamped",
    "/fix": "sensor_msgs/msg/NavSatFix",
    "/imu": "sensor_msgs/msg/Imu",
    "/odom": "nav_msgs/msg/Odometry",
    "/pose": "geometry_msgs/msg/PoseStamped",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/scan_1": "sensor_msgs/msg/LaserScan",
}


def fields_of(topic: str, number: int) -> dict[str, Any]:
    """Messages as a drive has them, of a robot that turns; frames as they are by default."""
    time = BEGIN + number * 100_000
    stamp = {"sec": time // 1_000_000, "nanosec": time % 1_000_000 * 1000}
    pixels = np.random.default_rng(number).integers(0, 255, (48, 64, 3), np.uint8)
    box = {"center": {"position": {"x": 32.0, "y": 24.0}}, "size_x": 8.0, "size_y": 4.0}
    hypotheses = [{"hypothesis": {"class_id": "cone" if number % 2 else "7", "score": 1.0}}]
    pose = {"pose": {"position": {"x": number * 0.5, "y": 1.0}, "orientation": {"z": 0.6, "w": 0.8}}}
    found: dict[str, tuple[str, dict[str, Any]]] = {
        "/camera/image_raw": (
            "camera_optical_frame",
            {"height": 48, "width": 64, "encoding": "bgr8", "step": 192, "data": pixels},
        ),
        "/cmd_vel": ("", {"linear": {"x": 0.5}, "angular": {"z": number / 128}}),
        "/detections": (
            "camera_optical_frame",
            {"detections": [{"bbox": box, "results": hypotheses}]},
        ),
        "/drive": ("base_link", {"drive": {"steering_angle": number / 64, "speed": 1.0}}),
        "/fix": ("gps", {"status": {"service": 1}, "latitude": 57.7, "longitude": 11.9, "altitude": float(number)}),
        "/imu": (
            "imu",
            {
                "orientation": {"w": 1.0},
                "orientation_covariance": [-1.0, *[0.0] * 8],
                "angular_velocity": {"x": 0.25},
                "linear_acceleration": {"z": 9.8125},
            },
        ),
        "/odom": ("odom", {"child_frame_id": "base_link", "pose": pose, "twist": {"twist": {"linear": {"x": 0.5}}}}),
        "/pose": ("map", pose),
        "/scan": (
            "laser",
            {"angle_min": -1.0, "angle_max": 0.0, "angle_increment": 0.5, "ranges": [1.0, np.inf, number]},
        ),
    }
    frame_id, fields = found[topic.removesuffix("_1")]
    return ({"header": {"stamp": stamp, "frame_id": frame_id}} if frame_id else {}) | fields


def write(path: Path, storage: str, compression: CompressionMode, topics: dict[str, str], count: int = 12) -> Path:
    with_compression = Writer(path, version=9, storage_plugin=STORAGES[storage])
    with_compression.set_compression(compression, CompressionFormat.ZSTD)
    with with_compression as writer:
        connections = {name: writer.add_connection(name, kind, typestore=TYPES.store) for name, kind in topics.items()}
        for number in range(count):
            for name, kind in topics.items():
                fields = fields_of(name, number) if name in TOPICS else {}
                writer.write(connections[name], (BEGIN + number * 100_000) * 1000, TYPES.encode(kind, fields))
    return path


def read(path: Path) -> dict[str, list[Any]]:
    found = defaultdict(list)
    with Reader(path) as reader:
        for connection, time, data in reader.messages():
            found[connection.topic].append((time, plain(TYPES.decode(connection.msgtype, data))))
            assert connection.msgtype == TOPICS[connection.topic]
    return found


def rounded(value: Any) -> Any:
    """Without the last digits, which boxes and angles lose on their way."""
    if isinstance(value, dict):
        return {name: rounded(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(each) for each in value]
    return round(value, 5) if isinstance(value, float) and abs(value) < 1e9 else value


@pytest.mark.thorough
@pytest.mark.parametrize("compression", [CompressionMode.NONE, CompressionMode.FILE, CompressionMode.MESSAGE])
@pytest.mark.parametrize("storage", STORAGES)
def test_a_bag_becomes_a_recording_and_a_bag_again(storage: str, compression: CompressionMode, tmp_path: Path) -> None:
    others = {"/tf": "tf2_msgs/msg/TFMessage", "/rosout": "std_msgs/msg/Bool"}
    bag = write(tmp_path / "bag", storage, compression, {**TOPICS, **others})
    code, stdout, stderr = dodo_rec("import", bag, "-o", tmp_path / "a.rec")
    assert (code, stderr) == (0, "")
    assert "  /scan_1 (sensor_msgs/msg/LaserScan): 12 -> robot.PlanarScan/1\n" in stdout
    assert "  /tf (tf2_msgs/msg/TFMessage): 12 -> left out\n" in stdout
    out = tmp_path / "out"
    code, stdout, stderr = dodo_rec("export", tmp_path / "a.rec", "--ros", "-o", out)
    assert (code, stderr) == (0, ""), stderr
    assert stdout.startswith(f"{out}: {12 * len(TOPICS)} messages of {len(TOPICS)} topics\n")
    found = read(out)
    assert found.keys() == TOPICS.keys()
    for name, kind in TOPICS.items():
        expected = [plain(TYPES.decode(kind, TYPES.encode(kind, fields_of(name, n)))) for n in range(12)]
        assert rounded([fields for _, fields in found[name]]) == rounded(expected), name
        assert [time for time, _ in found[name]] == [(BEGIN + n * 100_000) * 1000 for n in range(12)]


def test_one_file_is_a_bag_and_jpeg_stays_as_it_is(tmp_path: Path) -> None:
    jpeg = message("opendlv.proxy.ImageReading", BEGIN, 0, format="mjpg", width=8, height=8, data=b"\xff\xd8\xff\xd9")
    lonely = message("opendlv.proxy.GroundSteeringRequest", BEGIN, 0, groundSteering=1)
    early = message("opendlv.proxy.DistanceReading", -1, 0)
    (tmp_path / "a.rec").write_bytes(b"".join(map(encode_frame, [jpeg, lonely, early, *video(3, sender_stamp=2)])))
    words = "export", tmp_path / "a.rec", "--ros", "-o", tmp_path / "b", "--force"
    for version in ("0.9", "1.0"):
        code, stdout, stderr = dodo_rec(*words, "--messages", version)
        assert stderr == "dodo rec: skipped 1 message of /range: -1 us is before 1970\n"
        assert code == 0 and "  opendlv.proxy.GroundSteeringRequest: 1 -> left out\n" in stdout
    with Reader(tmp_path / "b" / "b.mcap") as reader:
        found = {c.topic: TYPES.decode(c.msgtype, data) for c, _, data in reader.messages()}
    assert found["/camera/image_raw/compressed"]["data"].tobytes() == b"\xff\xd8\xff\xd9"
    assert found["/camera_2/image_raw"]["width"] == 64


@pytest.mark.thorough
@pytest.mark.parametrize("storage", STORAGES)
def test_a_damaged_bag_is_an_error_in_one_sentence(storage: str, tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", storage, CompressionMode.NONE, {"/cmd_vel": TOPICS["/cmd_vel"]}, 3)
    file = next(path for path in bag.iterdir() if path.suffix != ".yaml")
    whole, target = file.read_bytes(), tmp_path / "a.rec"
    rng = np.random.default_rng(47)
    for cut in (0, 1, 40, *rng.integers(0, len(whole), 12).tolist()):
        file.write_bytes(whole[:cut])
        check(bag, target)
        damaged = bytearray(whole)
        damaged[cut : cut + 8] = rng.bytes(8)
        file.write_bytes(damaged)
        check(bag, target)
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    check(bag, target)


def check(bag: Path, target: Path) -> None:
    code, _, stderr = dodo_rec("import", bag, "-o", target, "--force")
    assert code in (0, 2), stderr
    assert code == 0 or (stderr.startswith("dodo rec: ") and stderr.count("\n") == 1), stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("import", "empty"), "'empty' is not a bag: it has no metadata.yaml"),
        (("import", "missing"), "missing: No such file"),
        (("import", "bag", "-o", "there.rec"), "'there.rec' exists already; --force replaces it"),
        (("import", "others"), "'others' has nothing for a recording: none of its topics has a type"),
        (("export", "there.rec", "--ros", "-o", "bag"), "exists already; --force replaces it"),
    ],
)
def test_what_is_refused(words: tuple[str, ...], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    write(tmp_path / "bag", "mcap", CompressionMode.NONE, {"/cmd_vel": TOPICS["/cmd_vel"]}, 1)
    write(tmp_path / "others", "mcap", CompressionMode.NONE, {"/tf": "tf2_msgs/msg/TFMessage"}, 1)
    assert dodo_rec("import", "bag", "-o", "there.rec").code == 0
    before = sorted(tmp_path.rglob("*"))
    code, _, stderr = dodo_rec(*words)
    assert code == 2 and said in stderr, stderr
    assert sorted(tmp_path.rglob("*")) == before


MAPPING = """dodo: 1
registry: []
messages: [lane_msgs/Lane.msg]
application:
  files: [compose.yml]
  services:
    car:
      ros:
        out:
          /estimate: nav_msgs/msg/Odometry
          /lane: {type: lane_msgs/msg/Lane, to: opendlv.proxy.GroundSteeringRequest/3, fields: {groundSteering: offset}}
"""


def test_topics_of_the_application_become_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lane_msgs").mkdir()
    (tmp_path / "lane_msgs/Lane.msg").write_text("float32 offset\n")
    (tmp_path / "dodo.yml").write_text(MAPPING)
    (tmp_path / "compose.yml").write_text("services: {car: {image: car}}\n")
    types, odometry = Types([tmp_path / "lane_msgs/Lane.msg"]), fields_of("/odom", 1)
    topics: dict[str, tuple[str, dict[str, Any]]] = {
        "/estimate": (TOPICS["/odom"], odometry),
        "/image": (TOPICS["/camera/image_raw"], fields_of("/camera/image_raw", 1)),
        "/lane": ("lane_msgs/msg/Lane", {"offset": 0.5}),
        "/odom": (TOPICS["/odom"], odometry),
    }
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for name, (kind, fields) in topics.items():
            connection = writer.add_connection(name, kind, typestore=types.store)
            writer.write(connection, BEGIN * 1000, types.encode(kind, fields))
    code, stdout, stderr = dodo_rec("import", "bag", "-o", "a.rec")
    assert (code, stderr) == (0, "")
    assert sorted(line.split(" -> ")[1] for line in stdout.splitlines()[1:]) == [
        "opendlv.proxy.GroundSteeringRequest/3",
        "opendlv.proxy.ImageReading/0",
        "robot.OdometryReading/0",
        "robot.PoseEstimate",
    ]
    (tmp_path / "dodo.yml").write_text(MAPPING.replace("offset", "ofset"))
    failed = dodo_rec("import", "bag", "-o", "a.rec", "--force")
    assert (failed.code, failed.stdout) == (2, "") and "there is no 'ofset' among offset" in failed.stderr
