"""What goes wrong between a test and its application's ROS graph, each in one sentence."""

import contextlib
import json
import os
import sys
import threading
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from difflib import SequenceMatcher
from pathlib import Path

from dodo_dsl.opendlv.ros_types import ACKERMANN_STAMPED, CAMERA_INFO, TWIST_STAMPED, RosGraph, Topic
from services.ros_bridge.graph import Discovered, Endpoint, listed

SETTLED, NAMELESS = 1.0, 5.0
"""Seconds without a change of the graph after which it is judged; nodes may give their names late."""
PATIENCE, ALONE = 3.0, 15.0
"""Seconds for which a topic may lack its other end, and a graph any node."""
AGE, AHEAD = 2.0, 0.2
"""Seconds by which a stamp may lie before and after its message's arrival."""
COMMANDS = frozenset({TWIST_STAMPED, ACKERMANN_STAMPED})
"""Types of which one without a stamp counts when it comes, as a Twist does; many nodes leave it out."""
_NEAR = 0.6
_MOST = 100
_SOCKETS = Path("/proc/net/udp")


@dataclass(frozen=True)
class Finding:
    """A sentence, said once for its key. An error keeps a test from its goal, a warning need not."""

    key: tuple[object, ...]
    text: str
    severity: str = "error"


def end_of(topic: Topic, writes: bool) -> Endpoint:
    reliable, durable = topic.reliability in ("", "reliable"), topic.durability == "transient_local"
    return Endpoint(b"", topic.topic, topic.type, writes, reliable, durable)


def problems(graph: RosGraph, seen: Discovered, waited: float) -> Iterator[Finding]:
    """What discovery shows ``waited`` seconds after the graph's first node, or the start where there is none."""
    for given, topics in ((True, graph.given), (False, graph.sent)):
        for topic in topics:
            for other in seen.of(topic.topic, not given):
                yield from _mismatch(topic, end_of(topic, given), other, seen.name(other))
    for topic in graph.sent:
        if len(publishers := seen.of(topic.topic, True)) > 1:
            names = seen.name(*publishers)
            who = f"{names} publish" if " and " in names else f"{names} has {len(publishers)} publishers"
            yield Finding(("crowd", topic.topic), f"{who} on {topic.topic}: the last message counts; let one publish")
    if not seen.participants and not seen.left and waited >= ALONE:
        services = listed({f"'{name}'" for names in graph.services.values() for name in names})
        text = f"no ROS node is in the graph: the programs of {services or 'the application'} ended, or have another"
        yield Finding(("alone",), f"{text} domain (ROS_DOMAIN_ID), another network, or no DDS")
    elif seen.participants and waited >= PATIENCE:
        yield from _missing(graph, seen)


def _mismatch(topic: Topic, own: Endpoint, other: Endpoint, node: str) -> Iterator[Finding]:
    verb, where = ("publishes", "out") if other.writes else ("listens to", "in")
    lacks = other.lacks(own) if other.writes else own.lacks(other)
    if other.type != own.type:
        text = f"{node} {verb} {topic.topic} as {other.type}, the test has {own.type}: write one type in both"
        yield Finding(("type", other.guid), f"{text} ('ros: {where}')")
    elif lacks and not (other.writes and not topic.reliability and lacks == "reliability"):  # a reader follows
        better, worse = {"reliability": ("reliable", "best_effort")}.get(lacks, ("transient_local", "volatile"))
        theirs, ours = (worse, better) if other.writes else (better, worse)
        text = f"{node} {verb} {topic.topic} with {lacks} {theirs}, the test with {ours}, so that they never meet"
        yield Finding((lacks, other.guid), f"{text}: write 'qos: {{{lacks}: {theirs}}}' at the topic")


def _missing(graph: RosGraph, seen: Discovered) -> Iterator[Finding]:
    known = {topic.topic for topic in (*graph.given, *graph.sent)}
    is_heard = any(seen.of(topic.topic, False) for topic in graph.given)
    for given, topics in ((True, graph.given), (False, graph.sent)):
        verb = "listens to" if given else "publishes"
        ends = [each for each in seen.endpoints.values() if each.topic and each.writes != given]
        loose = [each for each in ends if each.topic not in known and not seen.of(each.topic, given)]
        for topic in topics:
            lack, key = f"nobody {verb} {topic.topic} ({topic.type})", ("missing", topic.topic)
            if seen.of(topic.topic, not given):
                continue
            if other := _nearest(topic, loose):
                of = "" if other.type == topic.type else f" as {other.type}"
                remap = f"remap it (--ros-args -r {other.topic}:={topic.topic}){' and change its type' if of else ''}"
                yield Finding(key, f"{lack}; {seen.name(other)} {verb} {other.topic}{of}: {remap}")
            elif topic.type != CAMERA_INFO:
                names = listed({f"'{name}'" for each in seen.participants for name in seen.nodes.get(each, ())})
                rest = f"; the graph has {names or 'a node without a name'}"
                yield Finding(key, lack, "warning") if given and is_heard else Finding(key, lack + rest)


def _nearest(topic: Topic, others: Iterable[Endpoint]) -> Endpoint | None:
    """Of the same type, or else of nearly the same name."""
    ranked = ((e.type == topic.type, SequenceMatcher(None, topic.topic, e.topic).ratio(), e.topic, e) for e in others)
    return max((each for each in ranked if each >= (False, _NEAR)), key=lambda each: each[:3], default=(None,))[-1]


def frame_problem(topic: Topic, frame_id: str, expected: str) -> str:
    """Of a message's ``header.frame_id``; empty for none. An empty frame is as good as none."""
    allowed = {"odom", "map"} if expected in ("odom", "map") else {expected}
    if not frame_id or not expected or frame_id.lstrip("/") in allowed:
        return ""
    return f"{topic.topic} comes in frame '{frame_id:.60}'; expected '{expected}'"


def stamp_problem(topic: Topic, stamp_us: int, now_us: int) -> str:
    age = (now_us - stamp_us) / 1e6
    if stamp_us == 0:
        missing = f"{topic.topic} comes without a stamp; expected that of what it answers (header.stamp)"
        return "" if topic.type in COMMANDS else missing
    if -AHEAD <= age <= AGE:
        return ""
    which = f"{abs(age):.1f} s {'behind' if age > 0 else 'ahead of'} the test's time"
    return f"the stamps of {topic.topic} are {which}: copy header.stamp of what it answers, or take the node's clock"


def loss(topic: Topic, node: str, size: int, lost: int) -> str:
    return (
        f"{lost} datagrams were lost: {node} hears {topic.topic} by best effort, and its receive buffer is smaller "
        f"than a picture ({size} bytes): 'sudo sysctl -w net.core.rmem_max={4 * size}', or subscribe reliably"
    )


def lost_datagrams() -> int:
    """How many the kernel dropped for full buffers at the ports of the domain (DDSI-RTPS, 9.6.1)."""
    lost, first = 0, 7400 + 250 * int(os.environ.get("ROS_DOMAIN_ID") or 0)
    with contextlib.suppress(OSError):
        for words in map(str.split, _SOCKETS.read_text().splitlines()[1:]):
            if len(words) > 12 and 0 <= int(words[1].rpartition(":")[2], 16) - first < 250:
                lost += int(words[12])
    return lost


class Findings:
    """Says each finding once: a line of JSON for the runner, and a plain one for the log."""

    def __init__(self, graph: RosGraph, seen: Discovered) -> None:
        self._graph, self._seen = graph, seen
        self._said: set[tuple[object, ...]] = set()
        self._later: dict[tuple[str, str], tuple[Topic, str]] = {}
        self._lock = threading.RLock()
        self._changes, self._changed, self._first = 0, 0.0, 0.0

    def say(self, finding: Finding) -> None:
        with self._lock:
            if finding.key in self._said or len(self._said) >= _MOST:
                return
            self._said.add(finding.key)
        record = {"dodo": "ros", "finding": finding.text, "severity": finding.severity}
        print(json.dumps(record, ensure_ascii=False), flush=True)
        print(f"ros-bridge: {finding.severity}: {' '.join(finding.text.split())}", file=sys.stderr, flush=True)

    def say_later(self, kind: str, topic: Topic, text: str) -> None:
        """An error of what a node sent, when its name is known; nothing for an empty text."""
        with self._lock:
            if text:
                self._later.setdefault((kind, topic.topic), (topic, text))

    def look(self, now: float, last: bool = False) -> None:
        """Judges the graph when it has settled, or at the ``last``; ``now`` in seconds."""
        if not self._first or (self._seen.participants and not self._changes):
            self._first = now
        if self._seen.changes != self._changes:
            self._changes, self._changed = self._seen.changes, now
        is_named = self._seen.participants <= self._seen.nodes.keys()
        if not last and now - self._changed < (SETTLED if is_named else NAMELESS):
            return
        if not last or not self._seen.left:  # at the end nodes may be going
            for finding in problems(self._graph, self._seen, now - self._first + last * ALONE):
                self.say(finding)
        with self._lock:
            later, self._later = self._later, {}
        for key, (topic, text) in later.items():
            self.say(Finding(key, f"{text} (from {self._seen.name(*self._seen.of(topic.topic, True))})"))
