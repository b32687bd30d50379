"""Bytes of ROS messages: there and back, against rclpy, and what does not fit."""

import json
import os
import random
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.ros_codec import Codec, RosTypeError
from tests.opendlv.ros.values import CARRIED, plain, some_fields

ROOT = Path(__file__).parents[3]
PYTHON = Path(os.environ.get("DODO_ROS_PYTHON", ROOT / "build/ros/bin/python"))
CODEC = Codec()
TWIST, DETECTIONS = "geometry_msgs/msg/Twist", "vision_msgs/msg/Detection2DArray"


@pytest.mark.parametrize("type_", CARRIED)
@given(rng=st.randoms(use_true_random=False))
def test_what_is_encoded_is_decoded(type_: str, rng: random.Random) -> None:
    fields = some_fields(CODEC, type_, rng)
    data = CODEC.encode(type_, fields)
    assert data[:4] == b"\0\1\0\0"
    assert plain(CODEC.decode(type_, data)) == plain(fields)
    assert CODEC.encode(type_, CODEC.decode(type_, data)) == data


@pytest.mark.thorough
@pytest.mark.skipif(not PYTHON.exists(), reason="no Python with rclpy: name one in DODO_ROS_PYTHON")
def test_rclpy_reads_and_writes_the_same() -> None:
    rng = random.Random(47)
    sent = [(type_, some_fields(CODEC, type_, rng)) for type_ in CARRIED for _ in range(5)]
    lines = [json.dumps([type_, CODEC.encode(type_, fields).hex()]) for type_, fields in sent]
    peer = subprocess.run(
        [PYTHON, Path(__file__).with_name("rclpy_peer.py")],
        input="\n".join(lines),
        env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
        capture_output=True,
        text=True,
        check=True,
    )
    compared = set()
    for (type_, fields), line in zip(sent, peer.stdout.splitlines(), strict=True):
        if (found := json.loads(line)) is not None:
            compared.add(type_.partition("/")[0])
            assert found[0] == plain(fields), type_
            assert plain(CODEC.decode(type_, bytes.fromhex(found[1]))) == plain(fields), type_
    assert compared >= {"sensor_msgs", "geometry_msgs", "std_msgs"}


@pytest.mark.parametrize(
    ("type_", "fields", "said"),
    [
        ("geometry_msgs/msg/Twis", {}, "the ROS type 'geometry_msgs/msg/Twis' is not known"),
        (TWIST, {"linear": {"x": "fast"}}, "a value does not fit geometry_msgs/msg/Twist: "),
        ("sensor_msgs/msg/Image", {"height": -1}, "a value does not fit"),
        ("sensor_msgs/msg/Image", {"encoding": 5}, "a value does not fit"),
        ("sensor_msgs/msg/Imu", {"orientation_covariance": [1.0]}, "Imu: Unexpected array length"),
        ("std_msgs/msg/Float32", {"data": 1e39}, "a value does not fit std_msgs/msg/Float32: float too large"),
        (DETECTIONS, {"detections": 1}, "a value does not fit"),
    ],
)
def test_values_that_do_not_fit(type_: str, fields: dict[str, object], said: str) -> None:
    with pytest.raises(RosTypeError) as error:
        CODEC.encode(type_, fields)
    assert said in str(error.value)


@given(st.sampled_from(CARRIED), st.binary(max_size=80))
def test_any_bytes_are_decoded_or_refused(type_: str, data: bytes) -> None:
    for each in (data, b"\0\1\0\0" + data):
        try:
            CODEC.decode(type_, each)
        except RosTypeError as error:
            assert f"{len(each)} bytes are no {type_}" in str(error)


def test_own_types(tmp_path: Path) -> None:
    files = {
        "lane_msgs/msg/Lane.msg": "std_msgs/Header header\nuint8 count\nbool seen\nstring[] labels\nPoint2[] points\n",
        "lane_msgs/Point2.msg": "float64 x\nfloat64[2] y\n",
        "Mode.idl": "module team_msgs { module msg { struct Mode { long number; string text; }; }; };",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    codec = Codec([tmp_path / name for name in files])
    assert codec.own == ("lane_msgs/msg/Lane", "lane_msgs/msg/Point2", "team_msgs/msg/Mode")
    rng = random.Random(47)
    for type_ in codec.own * 10:
        fields = some_fields(codec, type_, rng)
        assert plain(codec.decode(type_, codec.encode(type_, fields))) == plain(fields)


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({"p/msg/A.msg": "q/B b\n"}, "own types do not fit: Type 'q/msg/B' is unknown"),
        ({"p/msg/A.msg": "float32 = 3\n"}, "A.msg: "),
        ({"p/A.idl": "struct {"}, "A.idl: "),
        ({"std_msgs/msg/Header.msg": "string text\n"}, "own types do not fit: Type 'std_msgs/msg/Header'"),
        ({"p/msg/A.msg": "\xff"}, "A.msg: 'utf-8' codec can't decode"),
    ],
)
def test_files_that_are_refused(files: dict[str, str], said: str, tmp_path: Path) -> None:
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(text.encode("latin-1"))
    with pytest.raises(RosTypeError) as error:
        Codec([tmp_path / name for name in files])
    assert said in str(error.value)
    with pytest.raises(RosTypeError, match="No such file"):
        Codec([tmp_path / "Missing.msg"])
