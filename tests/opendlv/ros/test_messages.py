"""ROS messages of those of the bus, and back: values, units, frames of reference, and what is refused."""

import math
import random
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dodo_dsl.opendlv import pixels
from dodo_dsl.opendlv import ros_types as ros
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.ros_fields import PATHS
from dodo_dsl.opendlv.ros_messages import Types
from dodo_dsl.opendlv.ros_pictures import CameraPicture, picture_of
from dodo_dsl.opendlv.ros_types import CameraView, StaticFrame, Topic
from tests.opendlv.ros.values import plain

TYPES, MESSAGES = Types(), MessageSet.standard()
TIME, RECEIVED = 1_700_000_000_123_456, 1_700_000_001_000_000
CAMERA = CameraView(width=640, height=480, fovy=48.8)
WAYS = [(type_, bus) for type_, ways in ros.GIVEN.items() for bus in ways if bus != (ros.MEMORY,)]
WAYS += [(type_, bus) for type_, bus in ros.SENT.items() if type_ != ros.DETECTIONS]
WAYS += [(type_, (ros.STEERING,)) for type_ in ros.NUMBERS]


def topic(type_: str, *bus: str, **others: Any) -> Topic:
    return Topic(topic="/t", type=type_, bus=bus, **others)


def message(name: str, **fields: Any) -> Any:
    return MESSAGES.type(name)(**fields)


def through(wanted: Topic, *messages: Any) -> dict[str, Any]:
    """The fields of a ROS message of those of the bus, as its bytes have them."""
    by_name = {each.DESCRIPTOR.full_name: each for each in messages}
    TYPES.check(wanted)
    return TYPES.decode(wanted.type, TYPES.encode(wanted.type, TYPES.given(wanted, by_name, TIME)))


def some_message(name: str, rng: random.Random) -> Any:
    found = message(name)
    for field in found.DESCRIPTOR.fields:
        if field.type == field.TYPE_BYTES:
            value: Any = np.array([rng.choice([math.inf, rng.uniform(0, 30)]) for _ in range(9)], "<f4").tobytes()
        else:
            value = float(np.float32(rng.uniform(-3, 3)))
        setattr(found, field.name, value)
    if name == ros.POSE_ESTIMATE:
        for axis, value in zip("xyzw", Rotation.random(rng=rng.randrange(2**31)).as_quat(), strict=True):
            setattr(found, f"q{axis}", value)
    return found


@pytest.mark.parametrize(("type_", "bus"), WAYS)
@given(rng=st.randoms(use_true_random=False))
def test_what_is_given_and_sent_again_is_the_same(type_: str, bus: tuple[str, ...], rng: random.Random) -> None:
    messages = [some_message(name, rng) for name in bus]
    wanted = topic(type_, *(f"{name}/{number}" for number, name in enumerate(bus)))
    found = TYPES.sent(wanted, through(wanted, *messages), RECEIVED)
    assert [each.stamp for each in found] == list(range(len(bus)))
    for each, original, name in zip(found, messages, bus, strict=True):
        assert each.sample_time == (TIME if TYPES.has_header(type_) else RECEIVED)
        for field in ["groundSteering"] if type_ in ros.NUMBERS else PATHS[type_, name]:
            expected, value = getattr(original, field), getattr(each.message, field)
            assert value == (expected if isinstance(expected, bytes) else pytest.approx(expected, abs=1e-9))


def test_each_type_with_a_header_has_a_frame() -> None:
    assert set(ros.FRAME_IDS) == {type_ for type_ in {*ros.GIVEN, *ros.SENT} if TYPES.has_header(type_)}


SCAN = {"angleMin": -0.5, "angleIncrement": 0.25, "rangeMin": 0.125, "rangeMax": 30.0}
RANGES = np.array([1, np.inf, 2.5, 0.25, 3], "<f4").tobytes()
UNKNOWN = [-1.0, *[0.0] * 8]


@pytest.mark.parametrize(
    ("wanted", "messages", "expected"),
    [
        (
            topic(ros.LASER_SCAN, ros.PLANAR_SCAN),
            [message(ros.PLANAR_SCAN, ranges=RANGES, **SCAN)],
            {"angle_max": 0.5, "range_max": 30.0, "ranges": [1.0, math.inf, 2.5, 0.25, 3.0]},
        ),
        (
            topic(ros.RANGE, ros.DISTANCE, frame_id="left"),
            [message(ros.DISTANCE, distance=math.inf)],
            {"range": math.inf, "min_range": 0.0, "max_range": math.inf, "header": {"frame_id": "left"}},
        ),
        (
            topic(ros.IMU, *ros.GIVEN[ros.IMU][0]),
            [message(ros.ANGULAR, angularVelocityZ=0.5), message(ros.ACCELERATION)],
            {
                "angular_velocity": {"z": 0.5},
                "orientation": {"w": 1.0},
                "orientation_covariance": UNKNOWN,
                "header": {"frame_id": "imu", "stamp": {"sec": 1_700_000_000, "nanosec": 123_456_000}},
            },
        ),
        (
            topic(ros.ODOMETRY, ros.ODOMETRY_READING),
            [message(ros.ODOMETRY_READING, x=1, y=2, yaw=math.pi / 2, vx=0.5, yawRate=-0.25)],
            {
                "header": {"frame_id": "odom"},
                "child_frame_id": "base_link",
                "pose": {"pose": {"position": {"x": 1.0, "y": 2.0, "z": 0.0}, "orientation": {"z": math.sqrt(0.5)}}},
                "twist": {"twist": {"linear": {"x": 0.5}, "angular": {"z": -0.25}}},
            },
        ),
        (
            topic(ros.CAMERA_INFO, "video0.bgr", camera=CAMERA),
            [],
            {
                "width": 640,
                "distortion_model": "plumb_bob",
                "k": pytest.approx([529.07, 0, 319.5, 0, 529.07, 239.5, 0, 0, 1], abs=0.01),
                "header": {"frame_id": "camera_optical_frame"},
            },
        ),
    ],
)
def test_what_is_given(wanted: Topic, messages: list[Any], expected: dict[str, Any]) -> None:
    def compare(found: Any, value: Any) -> None:
        if isinstance(value, dict):
            for name, each in value.items():
                compare(found[name], each)
        else:
            assert found == (pytest.approx(value, rel=1e-12) if isinstance(value, float) else value)

    compare(plain(through(wanted, *messages)), expected)


def test_a_place_without_altitude() -> None:
    found = through(topic(ros.NAV_SAT_FIX, ros.WGS84), message(ros.WGS84, latitude=1))
    assert math.isnan(found["altitude"])
    (back,) = TYPES.sent(topic(ros.NAV_SAT_FIX, ros.GEOLOCATION), found, RECEIVED)
    assert back.message.altitude == 0.0


def test_static_frames_turn_as_three_rotations() -> None:
    frame = StaticFrame(parent="base_link", child="laser", x=0.1, z=0.2, roll=0.3, pitch=-0.4, yaw=1.5)
    fields = TYPES.decode(ros.STATIC_FRAMES_TYPE, TYPES.encode(ros.STATIC_FRAMES_TYPE, TYPES.frames([frame], TIME)))
    (found,) = fields["transforms"]
    assert (found["header"]["frame_id"], found["child_frame_id"]) == ("base_link", "laser")
    assert found["transform"]["translation"] == {"x": 0.1, "y": 0.0, "z": 0.2}
    turned = [found["transform"]["rotation"][axis] for axis in "xyzw"]
    assert turned == pytest.approx(Rotation.from_euler("xyz", [0.3, -0.4, 1.5]).as_quat())


def detected(**box: float) -> dict[str, Any]:
    center = {"position": {"x": box["x"], "y": box["y"]}, "theta": box.get("theta", 0.0)}
    return {"center": center, "size_x": box["width"], "size_y": box["height"]}


def result(class_id: str, score: float) -> dict[str, Any]:
    return {"hypothesis": {"class_id": class_id, "score": score}}


@pytest.mark.parametrize("kept", [(0, 1, 2), (0, 1)])
def test_detections_are_fractions_of_the_picture(kept: tuple[int, ...]) -> None:
    bus = [f"{ros.SENT[ros.DETECTIONS][number]}/3" for number in kept]
    wanted = topic(ros.DETECTIONS, *bus, camera=CAMERA)
    detections = [
        {"bbox": detected(x=320, y=120, width=64, height=48), "results": [result("blue", 0.4), result("yellow", 0.5)]},
        {"bbox": detected(x=320, y=240, width=64, height=48, theta=math.pi / 2), "results": [result("7", 1.0)]},
        {"bbox": detected(x=0, y=0, width=64, height=48)},
    ]
    fields = {"header": {"stamp": {"sec": 5, "nanosec": 10_000}}, "detections": detections}
    found = TYPES.sent(wanted, TYPES.decode(ros.DETECTIONS, TYPES.encode(ros.DETECTIONS, fields)), RECEIVED)
    assert {(each.stamp, each.sample_time) for each in found} == {(3, 5_000_010)}
    names = {each.message.DESCRIPTOR.name: each.message.DESCRIPTOR.fields_by_name for each in found}
    rows = [
        (name := each.message.DESCRIPTOR.name, *[getattr(each.message, it) for it in names[name]][1:]) for each in found
    ]
    number = ("DetectionType", 1, 7) if 2 in kept else ("DetectionProperty", 1, "7")
    assert rows == [
        ("DetectionBoundingBox", 0, *map(pytest.approx, (0.45, 0.2, 0.1, 0.1))),
        ("DetectionProperty", 0, "yellow"),
        ("DetectionBoundingBox", 1, *map(pytest.approx, (0.4625, 0.5 - 32 / 480, 48 / 640, 64 / 480))),
        number,
        ("DetectionBoundingBox", 2, *map(pytest.approx, (-0.05, -0.05, 0.1, 0.1))),
    ]


@pytest.mark.parametrize("encoding", ["", "bgr8", "rgb8", "bgra8", "mono8"])
@pytest.mark.parametrize("format_", ["argb", "bgr", "rgb"])
@pytest.mark.parametrize("type_", [ros.IMAGE, ros.COMPRESSED])
def test_pictures(type_: str, format_: str, encoding: str) -> None:
    memory = pixels.converted(np.random.default_rng(47).integers(0, 255, (6, 8, 3), np.uint8), "bgr", format_)
    original = pixels.converted(memory, format_, "bgr")
    picture = CameraPicture(pixels.view(memory.tobytes() + b"behind", format_, 8, 6), format_)
    wanted = topic(type_, f"video0.{format_}", encoding="png" if type_ == ros.COMPRESSED else encoding)
    TYPES.check(wanted)
    found = TYPES.decode(type_, TYPES.encode(type_, TYPES.given(wanted, {}, TIME, picture)))
    assert found.get("encoding", found.get("format")) == (wanted.encoding or "bgr8")
    if encoding == "mono8" and type_ == ros.IMAGE:
        original = cv2.cvtColor(cv2.cvtColor(original, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
    assert np.abs(picture_of(type_, found).astype(int) - original).max() <= (encoding == "mono8")
    if type_ == ros.IMAGE and encoding == "rgb8":
        assert found["data"][:3].tolist() == original[0, 0, ::-1].tolist()
        assert (found["step"], found["height"], found["width"]) == (24, 6, 8)


SWITCH = "opendlv.proxy.SwitchStateReading"
REFUSED = [
    (topic(ros.TWIST, ros.MOTION_REQUEST), {"linear": {"x": math.nan}}, "linear.x of /t is nan, which"),
    (topic("std_msgs/msg/Float64", SWITCH), {"data": 0.5}, f"is 0.5, which {SWITCH}.state (int16) cannot be"),
    (topic("std_msgs/msg/String", ros.STEERING, fields={"groundSteering": "data"}), {"data": "1"}, "is '1', which"),
    (topic(ros.ODOMETRY, ros.ODOMETRY_READING), {}, "pose.pose.orientation of /t is {'x': 0.0"),
    (
        topic(ros.DETECTIONS, ros.SENT[ros.DETECTIONS][0], camera=CameraView(width=0, height=0)),
        {},
        "needs its camera's size",
    ),
]


@pytest.mark.parametrize(("wanted", "fields", "said"), REFUSED)
def test_what_is_sent_and_cannot_be_taken(wanted: Topic, fields: dict[str, Any], said: str) -> None:
    decoded = TYPES.decode(wanted.type, TYPES.encode(wanted.type, fields))
    with pytest.raises(ValueError) as error:
        TYPES.sent(wanted, decoded, RECEIVED)
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("wanted", "messages", "said"),
    [
        (topic(ros.RANGE, ros.DISTANCE), [], f"is made of {ros.DISTANCE}, too: there is none yet"),
        (topic(ros.IMAGE, "video0.bgr"), [], "/t needs a picture"),
        (topic(ros.IMAGE, "video0.bgr", encoding="png"), [], "the encoding 'png', expected one of bgr8, rgb8"),
        (topic(ros.CAMERA_INFO, "video0.bgr"), [], "or its camera"),
        (topic("sensor_msgs/msg/Rage", ros.DISTANCE), [], "the ROS type 'sensor_msgs/msg/Rage' is not known"),
        (topic(ros.TWIST, ros.STEERING), [], f"says nothing of {ros.STEERING} by itself"),
        (topic(ros.RANGE, "opendlv.proxy.DistanceRead"), [], "there is no message"),
        (topic(ros.RANGE, ros.DISTANCE, fields={"distance": "rang"}), [], "there is no 'rang' among header"),
        (topic(ros.RANGE, ros.DISTANCE, fields={"far": "range"}), [], "has the field 'far'"),
        (topic("std_msgs/msg/Float32", ros.ANGULAR), [], f"{ros.ANGULAR} has 3 fields, expected 'fields'"),
    ],
)
def test_what_cannot_be_given(wanted: Topic, messages: list[Any], said: str) -> None:
    with pytest.raises(ValueError) as error:
        through(wanted, *messages)
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"encoding": "yuv422", "width": 2, "height": 2}, "the encoding 'yuv422', expected one of bgr8"),
        (
            {"encoding": "bgr8", "width": 2, "height": 2, "step": 6, "data": [0] * 11},
            "11 bytes in rows of 6 are no bgr8",
        ),
        ({"encoding": "bgr8", "width": 0, "height": 2, "step": 6, "data": [0] * 12}, "of 0 x 2 pixels"),
        ({"encoding": "mono8", "width": 99999, "height": 99999, "step": 6}, "an image of 99999 x 99999 pixels"),
        ({"format": "jpeg", "data": [0] * 12}, "a picture of format 'jpeg' cannot be read"),
    ],
)
def test_pictures_that_are_none(fields: dict[str, Any], said: str) -> None:
    type_ = ros.COMPRESSED if "format" in fields else ros.IMAGE
    with pytest.raises(ValueError) as error:
        picture_of(type_, TYPES.decode(type_, TYPES.encode(type_, fields)))
    assert said in str(error.value)


def test_an_own_type_by_its_fields(tmp_path: Path) -> None:
    folder = tmp_path / "lane_msgs" / "msg"
    folder.mkdir(parents=True)
    (folder / "Lane.msg").write_text("std_msgs/Header header\nLane2 lane\n")
    (folder / "Lane2.msg").write_text("float32 offset\nint32 number\n")
    types = Types([folder / "Lane.msg", folder / "Lane2.msg"])
    wanted = topic("lane_msgs/msg/Lane", f"{ros.STEERING}/2", fields={"groundSteering": "lane.offset"}, frame_id="lane")
    types.check(wanted)
    fields = types.given(wanted, {ros.STEERING: message(ros.STEERING, groundSteering=0.5)}, TIME)
    decoded = types.decode(wanted.type, types.encode(wanted.type, fields))
    assert decoded["lane"] == {"offset": 0.5, "number": 0} and decoded["header"]["frame_id"] == "lane"
    assert types.sent(wanted, decoded, RECEIVED) == [(message(ros.STEERING, groundSteering=0.5), TIME, 2)]
