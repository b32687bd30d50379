import json
from collections.abc import Callable
from pathlib import Path

import pytest

from dodo_dsl.opendlv.envelope import encode_frame
from tests.rec.conftest import BEGIN, dodo_rec, message, video

STEERING = "opendlv.proxy.GroundSteeringRequest"


def test_messages_rates_and_gaps(record: Callable[..., Path]) -> None:
    times = [0, 100_000, 200_000, 500_000]
    path = record([message(STEERING, BEGIN + time, 3, groundSteering=0.1) for time in times])
    assert dodo_rec("info", path) == (
        0,
        f"{path}: 4 messages in 0.5 s, 206 bytes\nbegins 2023-11-14 22:13:20 UTC\nmessage set 1.0\n\n"
        "  id  message                              sender  count     rate  largest gap\n"
        "1090  opendlv.proxy.GroundSteeringRequest       3      4  6.00 Hz      0.300 s\n",
        "",
    )


def test_times_of_another_day_make_no_duration(record: Callable[..., Path]) -> None:
    """In lockstep an application's status may carry the machine's time among times of the test."""
    status = "opendlv.system.SystemStatusMessage"
    times = [0, 100_000, 200_000, 500_000]
    envelopes = [message(STEERING, BEGIN + time, 3, groundSteering=0.1) for time in times]
    years = 95_288_782_000_000
    path = record([*envelopes[:2], message(status, BEGIN + years, 1), *envelopes[2:]])
    head, begin, apart = dodo_rec("info", path).stdout.splitlines()[:3]
    assert head.startswith(f"{path}: 5 messages in 0.5 s, ")
    assert begin == "begins 2023-11-14 22:13:20 UTC"
    assert apart == "1 message is more than a day away from these and not counted"
    found = json.loads(dodo_rec("info", "--json", path).stdout)
    assert (found["duration"], found["apart"], found["unordered"]) == (0.5, 1, 0)
    path = record([message(status, BEGIN - years, 1), *envelopes, *[message(status, BEGIN + years, 1)] * 2])
    found = json.loads(dodo_rec("info", "--json", path).stdout)
    assert (found["begin"], found["duration"], found["apart"]) == (BEGIN / 1e6, 0.5, 3)


def test_json_for_programs(record: Callable[..., Path]) -> None:
    frames = video(12)
    envelopes = [message(STEERING, BEGIN, 1), *frames, message("dodo.EndOfInput", 0)]
    path = record(envelopes, before=b"\x0d\xa4abc", after=b"\x0d\xa4\xff")
    answer = dodo_rec("info", "--json", path)
    found = json.loads(answer.stdout)
    assert (answer.code, answer.stderr) == (0, "")
    assert (found["envelopes"], found["size"]) == (14, path.stat().st_size)
    assert found["frames"] == {"packets": 12, "decoded": 12}
    streams = [{key: row[key] for key in ("id", "name", "sender_stamp", "count")} for row in found["messages"]]
    assert streams == [
        {"id": 1055, "name": "opendlv.proxy.ImageReading", "sender_stamp": 0, "count": 12},
        {"id": 1090, "name": STEERING, "sender_stamp": 1, "count": 1},
        {"id": 2901, "name": "dodo.EndOfInput", "sender_stamp": 0, "count": 1},
    ]
    assert [(place["offset"], place["size"]) for place in found["skipped"]] == [(0, 5), (path.stat().st_size - 3, 3)]
    assert (found["skipped_places"], found["skipped_bytes"], found["untimed"]) == (2, 8, 1)
    assert "skipped 5 bytes at byte 0: a frame that is cut short" in dodo_rec("info", path, "--no-decode").stdout


def test_what_is_odd_is_said(record: Callable[..., Path]) -> None:
    path = record([])
    times = [BEGIN + 1, BEGIN, 0, *range(BEGIN + 2, BEGIN + 11)]
    path.write_bytes(b"".join(b"?" + encode_frame(message(STEERING, time)) for time in times))
    lines = dodo_rec("info", path).stdout.splitlines()
    assert "1 steps back in time, 1 messages without a sample time" in lines
    assert sum(line.startswith("skipped 1 byte at byte ") for line in lines) == 10
    assert "skipped 12 bytes at 12 positions in all" in lines


def test_frames_count_from_the_first_key_frame_that_is_whole(record: Callable[..., Path]) -> None:
    frames = video(12, key_frame_every=5)
    broken = frames[7]._replace(payload=frames[7].payload[:20])
    path = record([*frames[2:7], broken, *frames[8:], frames[0]._replace(payload=b"\xff")])
    found = json.loads(dodo_rec("info", "--json", path).stdout)["frames"]
    assert found["packets"] == 11
    assert found["decoded"] == 6, "frames 2 to 4 have no key frame, one is cut, one is no image"
    told = json.loads(dodo_rec("info", "--json", "--no-decode", path).stdout)["frames"]
    assert told == {"packets": 11, "decoded": None}


def test_a_codec_that_is_not_known_is_told_once(record: Callable[..., Path]) -> None:
    path = record([message("opendlv.proxy.ImageReading", BEGIN, format="AV99", data=b"x")] * 3)
    answer = dodo_rec("info", path)
    assert "3 packets, 0 decoded" in answer.stdout
    assert answer.stderr == (
        "dodo rec: frames of format 'AV99' cannot be decoded, expected one of h264, H264, VP80, VP90, mjpg, MJPG\n"
    )


def test_the_set_by_content_or_flag(record: Callable[..., Path]) -> None:
    old = message("opendlv.sim.KinematicState", BEGIN)._replace(data_type=1001)
    distance = message("opendlv.proxy.GroundSpeedReading", BEGIN)._replace(data_type=1134, payload=b"\x08\x01\x15abcd")
    box = message("opendlv.logic.perception.DetectionBoundingBox", BEGIN)
    for envelope, version, name in (
        (old, "0.9", "opendlv.sim.Frame"),
        (distance, "0.9", "opendlv.logic.perception.ObjectDistance"),
        (box, "1.0", "opendlv.logic.perception.DetectionBoundingBox"),
    ):
        found = json.loads(dodo_rec("info", "--json", record([envelope])).stdout)
        assert (found["message_set"], found["messages"][0]["name"]) == (version, name)
    forced = json.loads(dodo_rec("info", "--json", "--messages", "0.9", record([box])).stdout)
    assert forced["messages"][0]["name"] == "opendlv.logic.perception.ObjectDistance"
    forced = json.loads(dodo_rec("info", "--json", "--messages", "1.0", record([old])).stdout)
    assert forced["messages"][0]["name"] is None


@pytest.mark.parametrize(
    ("id_", "version", "name"),
    [
        (1032, "1.0", "opendlv.proxy.MagneticFieldReading"),
        (1118, "0.9", "opendlv.logic.sensation.Orientation"),
        (49, "1.0", "opendlv.proxy.PointCloudReading"),
    ],
)
def test_messages_of_either_set(id_: int, version: str, name: str, record: Callable[..., Path]) -> None:
    three = message("opendlv.proxy.AccelerationReading", BEGIN)._replace(data_type=id_)
    lines = dodo_rec("info", record([three])).stdout.splitlines()
    assert f"message set {version}" in lines and lines[-1].split()[:2] == [str(id_), name]


def test_own_messages(record: Callable[..., Path], tmp_path: Path) -> None:
    (tmp_path / "own.odvd").write_text("message team.Cone [id = 1144] { float x [id = 1]; }")
    path = record([message(STEERING, BEGIN)._replace(data_type=1144)])
    assert "team.Cone" in dodo_rec("info", path, "--messages", tmp_path / "own.odvd").stdout
    assert "(unknown)" in dodo_rec("info", path).stdout


def test_what_cannot_be_looked_into(tmp_path: Path, record: Callable[..., Path]) -> None:
    (tmp_path / "text.rec").write_text("hello")
    (tmp_path / "empty.rec").write_bytes(b"")
    path = record([message(STEERING, BEGIN)])
    for words, text in (
        ([tmp_path / "nowhere.rec"], "nowhere.rec: No such file or directory"),
        ([tmp_path], f"{tmp_path}: Is a directory"),
        ([tmp_path / "text.rec"], "text.rec is not a recording: its 5 bytes hold no message"),
        ([path, "--messages", "0.8"], "0.8: cannot be read: No such file or directory"),
    ):
        code, stdout, stderr = dodo_rec("info", *words)
        assert (code, stdout, stderr.count("\n")) == (2, "", 1)
        assert stderr.startswith("dodo rec: ") and stderr.endswith(f"{text}\n")
    assert "0 messages in 0.0 s, 0 bytes" in dodo_rec("info", tmp_path / "empty.rec").stdout


@pytest.mark.parametrize(
    ("name", "envelopes", "frames"),
    [("track-1-2025-05-08.rec", 591, 591), ("sim-2023-04-27.rec", 4972, 0), ("cones-2020-05-15.rec", 1595, 0)],
)
@pytest.mark.thorough
def test_recordings_of_others(name: str, envelopes: int, frames: int, shared_data: Callable[[str], Path]) -> None:
    found = json.loads(dodo_rec("info", "--json", shared_data(name)).stdout)
    assert (found["envelopes"], found["frames"]) == (envelopes, {"packets": frames, "decoded": frames})
    assert found["skipped"] == []
    assert found["message_set"] == ("0.9" if "2023" in name else "1.0")
