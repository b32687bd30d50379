"""What goes wrong between a test and its application's ROS graph, each in one sentence.

Rules look at what discovery told; what comes from the application is looked at message by message.
"""

import json
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from difflib import SequenceMatcher
from pathlib import Path

from dodo_dsl.opendlv.ros_types import RosGraph, Topic
from services.ros_bridge.discovered import Discovered, Endpoint

SETTLED = 1.0
"""Seconds without a change of the graph after which it is judged."""
PATIENCE = 3.0
"""Seconds for which a topic may lack its other end."""
ALONE = 15.0
"""Seconds after which a graph without any node is one."""
AGE = 2.0
"""Seconds by which a stamp may lie behind what is heard; more is another clock or an old message."""
AHEAD = 0.2
_ANOTHER_CLOCK = 600.0
RELIABLE, TRANSIENT = "reliable", "transient-local"
_NEAR = 0.6
_RECEIVE_LIMIT = Path("/proc/sys/net/core/rmem_max")
_SOCKETS = Path("/proc/net/udp")
_US = 1_000_000
_MOST = 100
_BUS_PORT = 12175

_CAMERA_INFO = "sensor_msgs/msg/CameraInfo"


@dataclass(frozen=True)
class Finding:
    """A sentence; an error makes the test's goal hard to reach, a warning need not. It is said once for its ``key``."""

    text: str
    key: tuple[object, ...]
    severity: str = "error"


def is_reliable(topic: Topic) -> bool:
    """Unless it says best effort."""
    return _word(topic.reliability) in ("", RELIABLE)


def is_durable(topic: Topic) -> bool:
    """Where it says transient local."""
    return _word(topic.durability) == TRANSIENT


def problems(graph: RosGraph, seen: Discovered, waited: float) -> Iterator[Finding]:
    """What discovery shows ``waited`` seconds after the graph's first node."""
    yield from _mismatches(graph, seen)
    yield from _crowds(graph.sent, seen)
    if waited >= PATIENCE:
        if not seen.participants:
            yield from _alone(graph, seen)
            return
        yield from _silent(seen)
        yield from _missing(graph, seen)


def _mismatches(graph: RosGraph, seen: Discovered) -> Iterator[Finding]:
    """Ends of one topic that never meet."""
    for given, topics in ((True, graph.given), (False, graph.sent)):
        for topic in topics:
            own = Endpoint(b"", b"", topic.topic, topic.type, given, is_reliable(topic), is_durable(topic))
            for other in seen.of(topic.topic, not given):
                yield from _mismatch(topic, own, other, seen)


def _mismatch(topic: Topic, own: Endpoint, other: Endpoint, seen: Discovered) -> Iterator[Finding]:
    node, verb = seen.name(other), "publishes" if other.writes else "listens to"
    if own.type_differs(other):
        key = "out" if other.writes else "in"
        yield Finding(
            f"{node} {verb} {other.type} on {topic.topic}, which is {own.type} in the test: "
            f"write one type in both ('ros: {key}')",
            ("type", topic.topic, other.guid),
        )
        return
    writer, reader = (other, own) if other.writes else (own, other)
    lacking = writer.lacks(reader)
    if other.writes and lacking == "reliability" and not topic.reliability:
        lacking = ""  # a reader follows its writer
    if lacking:
        wanted, offered = ("reliable", "best effort") if lacking == "reliability" else ("transient local", "volatile")
        at = "offers" if other.writes else "wants"
        yield Finding(
            f"{node} {verb} {topic.topic}, but never meets the test's end of it: {node} {at} "
            f"{offered if other.writes else wanted}, the test {'wants' if other.writes else 'offers'} "
            f"{wanted if other.writes else offered}: write 'qos: {{{lacking}: "
            f"{(offered if other.writes else wanted).replace(' ', '-')}}}' at the topic",
            (lacking, topic.topic, other.guid),
        )


def _crowds(sent: Iterable[Topic], seen: Discovered) -> Iterator[Finding]:
    for topic in sent:
        names = sorted(seen.name(each) for each in seen.of(topic.topic, True))
        if len(names) > 1:
            who = f"{names[0]} has two publishers" if names[0] == names[-1] else f"{_listed(names)} publish"
            text = f"{who} on {topic.topic}: what comes last counts; let one publish there"
            yield Finding(text, ("crowd", topic.topic))


def _alone(graph: RosGraph, seen: Discovered) -> Iterator[Finding]:
    if not seen.left:
        services = sorted({f"'{name}'" for names in graph.services.values() for name in names})
        of = f" of {_listed(services)}" if services else ""
        yield Finding(
            f"no ROS node is in the graph: the programs{of} ended, or use another domain (ROS_DOMAIN_ID), "
            "another network, or no DDS",
            ("alone",),
        )


def _silent(seen: Discovered) -> Iterator[Finding]:
    """Participants that announced themselves and nothing else."""
    speaking = {each.participant for each in seen.endpoints.values()}
    if seen.participants - speaking:
        text = "a ROS program announced itself, but none of its topics: it hangs or ended while it started"
        yield Finding(text, ("silent",))


def _missing(graph: RosGraph, seen: Discovered) -> Iterator[Finding]:
    known = {topic.topic for topic in (*graph.given, *graph.sent)}
    heard = [topic for topic in graph.given if seen.of(topic.topic, False)]
    for given, topics in ((True, graph.given), (False, graph.sent)):
        for topic in topics:
            if seen.of(topic.topic, not given):
                continue
            other = _nearest(topic, [each for each in seen.topics(not given) if _is_loose(each, known, seen)])
            lacks = f"nobody {'listens to' if given else 'publishes'} {topic.topic} ({topic.type})"
            if other:
                yield Finding(f"{lacks}; {_remedy(topic, other, seen)}", ("missing", topic.topic))
            elif topic.type != _CAMERA_INFO and (not given or not heard):
                yield Finding(f"{lacks}; {_nodes(seen)}", ("missing", topic.topic))
            elif topic.type != _CAMERA_INFO:
                yield Finding(lacks, ("missing", topic.topic), "warning")


def _is_loose(endpoint: Endpoint, known: set[str], seen: Discovered) -> bool:
    return endpoint.topic not in known and not seen.of(endpoint.topic, not endpoint.writes)


def _nearest(topic: Topic, others: Iterable[Endpoint]) -> Endpoint | None:
    """Of the same type, or else of nearly the same name."""

    def nearness(other: Endpoint) -> tuple[bool, float, str]:
        return other.type == topic.type, SequenceMatcher(None, topic.topic, other.topic).ratio(), other.topic

    likely = [each for each in others if nearness(each)[0] or nearness(each)[1] >= _NEAR]
    return max(likely, key=nearness, default=None)


def _remedy(topic: Topic, other: Endpoint, seen: Discovered) -> str:
    verb = "publishes" if other.writes else "listens to"
    of = "" if other.type == topic.type else f" ({other.type})"
    remap = f"remap it (--ros-args -r {other.topic}:={topic.topic})"
    return f"{seen.name(other)} {verb} {other.topic}{of}: {remap}{' and change its type' if of else ''}"


def _nodes(seen: Discovered) -> str:
    names = sorted({f"'{name}'" for key in seen.participants for name in seen.nodes.get(key, ())})
    return f"the graph has {_listed(names)}" if names else "the graph has no node with a name"


def frame_problem(topic: Topic, node: str, frame_id: str, expected: str) -> str:
    """Of a message's ``header.frame_id``, empty for none; an empty frame is as good as none."""
    allowed = {"odom", "map"} if expected in ("odom", "map") else {expected}
    if not frame_id or not expected or frame_id.lstrip("/") in allowed:
        return ""
    return f"{topic.topic} comes in frame '{frame_id:.60}' from {node}; expected '{expected}'"


def stamp_problem(topic: Topic, node: str, stamp_us: int, now_us: int) -> str:
    """Of a message's ``header.stamp``, empty for none."""
    if stamp_us == 0:
        return f"{topic.topic} comes without a stamp from {node}; expected that of what it answers (header.stamp)"
    age = (now_us - stamp_us) / _US
    if -AHEAD <= age <= AGE:
        return ""
    if abs(age) >= _ANOTHER_CLOCK:
        return (
            f"the stamps of {topic.topic} from {node} are of another clock, {_span(abs(age))} "
            f"{'behind' if age > 0 else 'ahead of'} the test's: copy header.stamp, or take the node's clock"
        )
    return f"{topic.topic} comes with stamps {_span(abs(age))} {'old' if age > 0 else 'ahead'} from {node}"


def loss(topic: Topic, node: str, size: int, limit: int, lost: int) -> str:
    """Of pictures that did not fit into a best-effort reader's buffer."""
    remedy = (
        f"'sudo sysctl -w net.core.rmem_max={4 * size}'"
        if limit < size
        else f"give the node one of {4 * size} bytes (FASTDDS_BUILTIN_TRANSPORTS, CYCLONEDDS_URI)"
    )
    return (
        f"{lost} datagrams were lost: {node} hears {topic.topic} by best effort, and its receive buffer is smaller "
        f"than a picture ({size} bytes): {remedy}, or subscribe reliably"
    )


def receive_limit() -> int:
    """The kernel's limit of receive buffers in bytes, 0 if it is not known."""
    try:
        return int(_RECEIVE_LIMIT.read_text())
    except (OSError, ValueError):
        return 0


def lost_datagrams(own: Iterable[int] = ()) -> int:
    """How many the kernel dropped for full buffers in this network, but those of the bus and of inodes ``own``."""
    lost, own = 0, set(own)
    try:
        lines = _SOCKETS.read_text().splitlines()[1:]
    except OSError:
        return 0
    for line in lines:
        words = line.split()
        if len(words) > 12 and int(words[1].rpartition(":")[2], 16) != _BUS_PORT and int(words[9]) not in own:
            lost += int(words[12])
    return lost


class Findings:
    """Says each finding once: a line of JSON for the runner, and a plain one for the log."""

    def __init__(self, graph: RosGraph, seen: Discovered) -> None:
        self._graph, self._seen = graph, seen
        self._said: set[tuple[object, ...]] = set()
        self._later: dict[tuple[object, ...], Callable[[], str]] = {}
        self._lock = threading.RLock()
        self._changes, self._changed, self._first = 0, 0.0, 0.0
        self._left: dict[bytes, float] = {}

    def say(self, finding: Finding) -> None:
        with self._lock:
            if finding.key in self._said or len(self._said) >= _MOST:
                return
            self._said.add(finding.key)
        record = {"dodo": "ros", "finding": finding.text, "severity": finding.severity}
        print(json.dumps(record, ensure_ascii=False), flush=True)
        print(f"ros-bridge: {finding.severity}: {finding.text}", file=sys.stderr, flush=True)

    def say_later(self, key: tuple[object, ...], text: Callable[[], str]) -> None:
        """An error, at the next look: by then the names of nodes are known."""
        with self._lock:
            if key not in self._said and len(self._later) < _MOST:
                self._later.setdefault(key, text)

    def look(self, now: float, last: bool = False) -> None:
        """Judges the graph when it has settled, or at the ``last``; ``now`` in seconds."""
        if not self._first or (self._seen.participants and not self._changes):
            self._first = now
        if self._seen.changes != self._changes:
            self._changes, self._changed = self._seen.changes, now
        if not last and now - self._changed < SETTLED:
            return
        waited = now - self._first - (0.0 if self._seen.participants else ALONE - PATIENCE)
        for finding in problems(self._graph, self._seen, PATIENCE if last and self._seen.participants else waited):
            self.say(finding)
        with self._lock:
            later, self._later = self._later, {}
        for key, text in later.items():
            self.say(Finding(text(), key))
        if not last:
            self._look_for_the_dead(now)

    def _look_for_the_dead(self, now: float) -> None:
        for key in self._seen.left:
            if now - self._left.setdefault(key, now) >= SETTLED and (names := self._seen.nodes.get(key)):
                who = _listed([f"'{name}'" for name in sorted(names)])
                text = f"{who} left the ROS graph during the test: the program ended or hangs"
                self.say(Finding(text, ("left", key), "warning"))


def _listed(names: Iterable[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def _span(seconds: float) -> str:
    for unit, length in (("days", 86_400.0), ("h", 3600.0)):
        if seconds >= length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.2f} s"


def _word(text: str) -> str:
    return text.lower().replace("_", "-")
