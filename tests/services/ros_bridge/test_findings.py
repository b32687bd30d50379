"""What is said of a graph, by what was discovered; and what strangers' messages do."""

import json
from pathlib import Path

import pytest

from dodo_dsl.opendlv.ros_types import MOTION_REQUEST, CameraView, RosGraph, Topic

pytest.importorskip("cyclonedds")

from dodo_dsl.opendlv.ros_messages import Types
from services.ros_bridge import findings
from services.ros_bridge.findings import ALONE, PATIENCE, SETTLED, Finding, Findings, problems
from services.ros_bridge.graph import Discovered, Endpoint

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
    seen.participants.add(key)
    for number, (topic, type_, writes) in enumerate(ends):
        guid = key + bytes([0, 0, number, 4])
        seen.add(Endpoint(guid, topic, type_, writes))
        seen.nodes.setdefault(key, set()).add(node)
        seen.changes += 1
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
            ["/cmd_vel_stamped as geometry_msgs/msg/TwistStamped: remap it (--ros-args -r /cmd_vel_stamped:=/cmd_vel)"],
        ),
        (graph_of(READS, WRITES, WRITES), ["'lane' has 2 publishers on /cmd_vel: the last message counts"]),
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
        (graph_of(), ["/image", "/cmd_vel"]),
        (Discovered(), ["no ROS node is in the graph: the programs of 'lane' ended, or have another domain"]),
    ],
)
def test_says_what_is_missing(seen: Discovered, expected: list[str]) -> None:
    said = [finding.text for finding in problems(GRAPH, seen, PATIENCE if seen.participants else ALONE)]
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
    said.say_later("frame", GRAPH.sent[0], "something")
    said.look(133.5, last=True)
    assert lines() == ["something (from a no"]


@pytest.mark.parametrize(("ended", "expected"), [(0, 1), (1, 0)])
def test_says_at_the_end_what_had_no_time_but_nothing_of_what_ends(
    ended: int, expected: int, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = graph_of(READS)
    said = Findings(GRAPH, seen)
    said.look(100.0)
    seen.left |= {b"lane".ljust(12)} if ended else set()
    said.look(100.5, last=True)
    assert len(capsys.readouterr().out.splitlines()) == expected


def test_a_flood_of_findings_and_of_a_graph_ends(capsys: pytest.CaptureFixture[str]) -> None:
    seen = Discovered()
    said = Findings(GRAPH, seen)
    for number in range(20_000):
        guid = number.to_bytes(16, "big")
        seen.add(Endpoint(guid, f"/{number}", TWIST, True))
        said.say(Finding((number,), "x"))
    assert len(seen.endpoints) == 10_000
    assert len(capsys.readouterr().out.splitlines()) == 100


def test_judges_stamps_and_frames() -> None:
    for stamp, said in (
        (0, "without a stamp"),
        (50_000_000, ""),
        (48_100_000, ""),
        (45_000_000, "5.0 s behind the test's time"),
        (51_000_000, "1.0 s ahead of the test's time"),
    ):
        text = findings.stamp_problem(GRAPH.sent[0], stamp, 50_000_000)
        assert (said in text) and bool(said) == bool(text), stamp
    for frame, expected in (("odom", "map"), ("", "laser"), ("/laser", "laser"), ("x", "")):
        assert not findings.frame_problem(GRAPH.sent[0], frame, expected)
    assert "in frame 'base'; expected 'laser'" in findings.frame_problem(GRAPH.sent[0], "base", "laser")
    drive = Topic(topic="/drive", type="ackermann_msgs/msg/AckermannDriveStamped", bus=GRAPH.sent[0].bus)
    assert not findings.stamp_problem(drive, 0, 50_000_000), "a command counts when it comes"


def test_counts_lost_datagrams_but_those_of_the_bus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [("0100007F:1CF3", 7), ("0100007F:1CF5", 9), ("0100007F:2F8F", 11)]
    lines = [f"1: {address} 0:0 07 0:0 00:0 0 0 0 5 2 0 {lost}" for address, lost in rows]
    (tmp_path / "udp").write_text("\n".join(["  sl", *lines, "broken"]))
    monkeypatch.setattr(findings, "_SOCKETS", tmp_path / "udp")
    assert findings.lost_datagrams() == 16


NODES = "rmw_dds_common/msg/ParticipantEntitiesInfo"


def test_names_nodes_and_takes_no_broken_names() -> None:
    types, seen = Types(), Discovered()
    gids = [{"data": [letter] * 16} for letter in b"PRW"]
    nodes = [
        {"node_namespace": space, "node_name": name, "reader_gid_seq": gids[1:2], "writer_gid_seq": gids[2:]}
        for space, name in (("/", "lane"), ("/team", "lane"))
    ]
    data = types.encode(NODES, {"gid": gids[0], "node_entities_info_seq": nodes})
    for end in range(len(data)):
        seen.add_nodes(types, data[:end])
    assert not seen.nodes
    seen.add_nodes(types, data)
    assert seen.nodes == {b"P" * 12: {"lane", "team/lane"}}
    assert seen.names == {b"R" * 16: "team/lane", b"W" * 16: "team/lane"}
