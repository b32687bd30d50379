"""What is said of a graph, by what discovery told; and what strangers' messages do."""

import json
import struct
from pathlib import Path

import pytest
from hypothesis import given, strategies

from dodo_dsl.opendlv.ros_types import MOTION_REQUEST, CameraView, RosGraph, Topic
from services.ros_bridge import findings
from services.ros_bridge.discovered import Discovered, Endpoint
from services.ros_bridge.findings import ALONE, PATIENCE, SETTLED, Finding, Findings, problems

IMAGE, TWIST, SCAN = "sensor_msgs/msg/Image", "geometry_msgs/msg/Twist", "sensor_msgs/msg/LaserScan"
INFO = "sensor_msgs/msg/CameraInfo"
CAMERA = CameraView(width=64, height=48, fovy=48.8)
GRAPH = RosGraph(
    given=(
        Topic(topic="/image", type=IMAGE, bus=("video0.bgr",)),
        Topic(topic="/info", type=INFO, bus=("video0.bgr",)),
    ),
    sent=(Topic(topic="/cmd_vel", type=TWIST, bus=(MOTION_REQUEST,)),),
    services={"/image": ("lane",), "/cmd_vel": ("lane",)},
)
READS, WRITES = ("/image", IMAGE, False), ("/cmd_vel", TWIST, True)


def graph_of(*ends: tuple[str, str, bool], node: str = "lane", seen: Discovered | None = None) -> Discovered:
    """A node with these ends: topic, type and whether it publishes."""
    seen = seen or Discovered()
    key = node.encode().ljust(12)
    seen.participant(key, True)
    for number, (topic, type_, writes) in enumerate(ends):
        guid = key + bytes([0, 0, number, 4])
        seen.endpoint(Endpoint(guid, key, topic, type_, writes))
        seen.named(key, node, [guid])
    return seen


@pytest.mark.parametrize(
    ("seen", "expected"),
    [
        (graph_of(READS, WRITES), []),
        (graph_of(READS, WRITES, ("/image_2", IMAGE, False)), []),
        (graph_of(READS, WRITES, ("/camera_info", INFO, False)), ["'lane' listens to /camera_info: remap it"]),
        (graph_of(READS), ["nobody publishes /cmd_vel (geometry_msgs/msg/Twist); the graph has 'lane'"]),
        (graph_of(WRITES), ["nobody listens to /image (sensor_msgs/msg/Image); the graph has 'lane'"]),
        (
            graph_of(READS, ("/cmd_vel_stamped", "geometry_msgs/msg/TwistStamped", True)),
            ["/cmd_vel_stamped (geometry_msgs/msg/TwistStamped): remap it (--ros-args -r /cmd_vel_stamped:=/cmd_vel)"],
        ),
        (graph_of(READS, WRITES, WRITES), ["'lane' has two publishers on /cmd_vel: what comes last counts"]),
        (graph_of(READS, WRITES, node="", seen=graph_of(WRITES)), ["'lane' and a program publish on /cmd_vel"]),
        (
            # a chain of two nodes has its own topics
            graph_of(
                ("/boxes", TWIST, False),
                ("/cmd_vel", TWIST, True),
                node="driver",
                seen=graph_of(READS, ("/boxes", TWIST, True)),
            ),
            [],
        ),
        (graph_of(), ["announced itself, but none of its topics", "/image", "/cmd_vel"]),
        (Discovered(), ["no ROS node is in the graph: the programs of 'lane' ended, or use another domain"]),
    ],
)
def test_says_what_is_missing(seen: Discovered, expected: list[str]) -> None:
    said = [finding.text for finding in problems(GRAPH, seen, PATIENCE)]
    assert len(said) == len(expected), said
    assert all(part in text for part, text in zip(expected, said, strict=True)), said


def test_a_topic_that_nobody_needs_is_a_warning() -> None:
    more = Topic(topic="/scan", type=SCAN, bus=("robot.PlanarScan",))
    graph = RosGraph(given=(*GRAPH.given, more), sent=GRAPH.sent)
    (finding,) = problems(graph, graph_of(READS, WRITES), PATIENCE)
    assert (finding.text, finding.severity) == ("nobody listens to /scan (sensor_msgs/msg/LaserScan)", "warning")


def test_says_once_what_has_settled(capsys: pytest.CaptureFixture[str]) -> None:
    seen = Discovered()
    said = Findings(GRAPH, seen)

    def lines() -> list[str]:
        return [json.loads(line)["finding"][:20] for line in capsys.readouterr().out.splitlines()]

    said.look(100.0)
    said.look(100.0 + ALONE - 0.1)
    assert lines() == []
    graph_of(READS, ("/cmd", TWIST, True), seen=seen)
    said.look(120.0)
    said.look(120.0 + SETTLED)
    assert lines() == []
    said.look(120.0 + PATIENCE)
    said.look(130.0)
    assert lines() == ["nobody publishes /cm"]
    seen.participant(b"lane".ljust(12), False)
    said.look(131.0)
    said.look(132.0)
    said.look(133.0 + SETTLED)
    said.look(140.0, last=True)
    assert lines() == ["'lane' left the ROS "]


def test_says_at_the_end_what_had_no_time(capsys: pytest.CaptureFixture[str]) -> None:
    said = Findings(GRAPH, graph_of(READS))
    said.say_later(("frame",), lambda: "by then it has a name")
    said.look(1.0, last=True)
    assert len(capsys.readouterr().out.splitlines()) == 2


def test_a_flood_of_findings_and_of_a_graph_ends(capsys: pytest.CaptureFixture[str]) -> None:
    seen = Discovered()
    said = Findings(GRAPH, seen)
    for number in range(20_000):
        guid = number.to_bytes(16, "big")
        seen.endpoint(Endpoint(guid, guid[:12], f"/{number}", TWIST, True))
        seen.named(guid[:12], "n", [guid])
        said.say(Finding("x", (number,)))
    assert len(seen.endpoints) == len(seen.names) == 10_000
    assert len(capsys.readouterr().out.splitlines()) == 100


@pytest.mark.parametrize(
    ("stamp", "said"),
    [
        (0, "without a stamp"),
        (50_000_000, ""),
        (48_100_000, ""),
        (45_000_000, "with stamps 5.00 s old"),
        (51_000_000, "with stamps 1.00 s ahead"),
        (1, ""),
    ],
)
def test_judges_stamps(stamp: int, said: str) -> None:
    text = findings.stamp_problem(GRAPH.sent[0], "'lane'", stamp, 50_000_000 if stamp != 1 else 1_000_000)
    assert (said in text) and bool(said) == bool(text)


@pytest.mark.parametrize(
    ("frame", "expected", "is_said"),
    [
        ("odom", "map", False),
        ("", "laser", False),
        ("/laser", "laser", False),
        ("base", "laser", True),
        ("x", "", False),
    ],
)
def test_judges_frames(frame: str, expected: str, is_said: bool) -> None:
    assert bool(findings.frame_problem(GRAPH.sent[0], "'lane'", frame, expected)) == is_said


def test_says_what_a_larger_buffer_needs() -> None:
    topic = GRAPH.given[0]
    assert "net.core.rmem_max=400" in findings.loss(topic, "'lane'", 100, 50, 3)
    assert "FASTDDS_BUILTIN_TRANSPORTS" in findings.loss(topic, "'lane'", 100, 100, 3)
    assert findings.lost_datagrams() >= 0
    assert findings.receive_limit() > 0


def test_counts_lost_datagrams_of_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [("0100007F:1CF3", 5, 7), ("0100007F:1CF5", 6, 9), ("0100007F:2F8F", 8, 11)]
    lines = [f"1: {address} 0:0 07 0:0 00:0 0 0 0 {inode} 2 0 {lost}" for address, inode, lost in rows]
    table = tmp_path / "udp"
    table.write_text("\n".join(["  sl", *lines, "broken"]))
    monkeypatch.setattr(findings, "_SOCKETS", table)
    assert (findings.lost_datagrams(), findings.lost_datagrams([6])) == (16, 7)


def entities(gid: int, *nodes: str) -> bytes:
    """A ``ParticipantEntitiesInfo`` as nodes send it."""
    data = b"\0\1\0\0" + b"P" * gid + struct.pack("<I", len(nodes))
    for node in nodes:
        for text in ("/", node):
            data += b"\0" * (-(len(data) - 4) % 4) + struct.pack("<I", len(text) + 1) + text.encode() + b"\0"
        for guid in (b"R", b"W"):
            data += b"\0" * (-(len(data) - 4) % 4) + struct.pack("<I", 1) + guid * gid
    return data


@pytest.mark.parametrize("gid", [16, 24])
def test_reads_the_names_of_nodes(gid: int) -> None:
    nodes = pytest.importorskip("services.ros_bridge.graph").nodes_of(entities(gid, "lane", "driver"))
    assert list(nodes) == [(b"P" * 12, name, [b"R" * 16, b"W" * 16]) for name in ("lane", "driver")]


@given(strategies.binary(max_size=200), strategies.integers(0, 200))
def test_broken_names_are_none(tail: bytes, cut: int) -> None:
    graph = pytest.importorskip("services.ros_bridge.graph")
    list(graph.nodes_of(entities(16, "lane")[:cut] + tail))
