"""Between the test's bus and shared memories and the application's ROS graph.

One thread takes messages of the bus, one each a memory's pictures, one what the graph sends and tells, one gives the
time. The bridge has the application's clock, so that its times are those of frames and messages.
"""

import contextlib
import os
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.pixels import PixelError
from dodo_dsl.opendlv.ros_fields import FRAME_IDS
from dodo_dsl.opendlv.ros_messages import CameraPicture, RosTypeError, Types, time_of
from dodo_dsl.opendlv.ros_types import (
    CLOCK,
    CLOCK_TYPE,
    GIVEN,
    MEMORY,
    STATIC_FRAMES,
    STATIC_FRAMES_TYPE,
    RosGraph,
    Topic,
)
from dodo_dsl.opendlv.session import Session, SessionError
from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError
from services.ros_bridge import findings
from services.ros_bridge.discovered import Discovered, Endpoint
from services.ros_bridge.findings import Finding, Findings, is_durable, is_reliable
from services.ros_bridge.graph import Graph, Reader, Writer

START_PATIENCE = 5.0
"""Seconds for which the first picture and the first time wait for nodes that are to hear them."""
CLOCK_STEP = 10_000
_LOOK = 1.0
_LARGEST_ANSWER = 1 << 20
_FORMATS = {4.0: "argb", 3.0: "bgr", 1.5: "i420"}
_BETTER_LATE = 5.0
_SOCKET = re.compile(r"socket:\[(\d+)\]")


class BridgeError(RuntimeError):
    """What ends the bridge, in one sentence."""


@dataclass
class Given:
    """A topic that the application gets; ``heard`` by so many."""

    topic: Topic
    writer: Writer
    heard: int = 0
    fresh: set[str] = field(default_factory=set)
    last: int | None = None

    def is_due(self, time_us: int) -> bool:
        """Whether its rate lets it be published again."""
        if self.topic.rate and self.last is not None and time_us - self.last < 1e6 / self.topic.rate - 1000:
            return False
        self.last = time_us
        return True


@dataclass
class Sent:
    """A topic that the application publishes."""

    topic: Topic
    reader: Reader
    reliable: bool


def is_picture(topic: Topic) -> bool:
    """Whether it is made of a shared memory."""
    return GIVEN.get(topic.type) == ((MEMORY,),)


def memories_of(graph: RosGraph) -> tuple[str, ...]:
    """The shared memories of a graph, in the order of its topics."""
    return tuple(dict.fromkeys(topic.bus[0] for topic in graph.given if is_picture(topic)))


def definitions(graph: RosGraph, folder: Path) -> tuple[MessageSet, list[Path]]:
    """The messages of a graph's bus, and files with its own types, which are written into a folder."""
    (folder / "own.odvd").write_text(graph.messages, encoding="utf-8")
    files = [folder / name for name in graph.types]
    for file, text in zip(files, graph.types.values(), strict=True):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    return MessageSet.load(*([folder / "own.odvd"] if graph.messages else [])), files


class Bridge:
    """Connects what was made for it; ``run`` never returns."""

    def __init__(
        self, session: Session, graph: Graph, topics: RosGraph, types: Sequence[Path] = (), names: Sequence[str] = ()
    ) -> None:
        """``names`` are those of the memories as they are, where they differ; raises what any part of it raises."""
        self._session, self._graph, self._topics = session, graph, topics
        memories = memories_of(topics)
        if names and len(names) != len(memories):
            raise BridgeError(f"--name is given {len(names)} times for the memories {', '.join(memories) or 'of none'}")
        self._names = dict(zip(memories, names or memories, strict=True))
        self._types = Types(types, session.messages)
        for topic in (*topics.given, *topics.sent):
            self._types.check(topic)
        self._seen = Discovered()
        self._findings = Findings(topics, self._seen)
        self._ready, self._clock_heard = threading.Event(), threading.Event()
        self._clock = graph.writer(CLOCK, CLOCK_TYPE, depth=1)
        self._given = [Given(topic, self._writer(topic)) for topic in topics.given]
        self._sent = [Sent(topic, self._reader(topic, True), is_reliable(topic)) for topic in topics.sent]
        if topics.frames:
            self._frames = graph.writer(STATIC_FRAMES, STATIC_FRAMES_TYPE, durable=True, depth=1)
            self._frames.write(self._types.encode(STATIC_FRAMES_TYPE, self._types.frames(topics.frames, now_us())))
        self._lost_before, self._lost_since = self._lost(), 0.0

    def run(self) -> NoReturn:
        """Until SIGTERM ends it, or the bus or a memory is lost."""
        signal.signal(signal.SIGTERM, self._end)
        signal.signal(signal.SIGINT, self._end)
        works: list[Callable[[], None]] = [self._hear_graph, self._give_time]
        works += [lambda name=name: self._show(name) for name in self._names]  # type: ignore[misc]
        for work in works:
            threading.Thread(target=_guarded, args=(work,), daemon=True).start()
        _guarded(self._hear_bus)
        raise AssertionError

    def _writer(self, topic: Topic) -> Writer:
        return self._graph.writer(
            topic.topic, topic.type, reliable=is_reliable(topic), durable=is_durable(topic), depth=topic.depth
        )

    def _reader(self, topic: Topic, reliable: bool) -> Reader:
        return self._graph.reader(
            topic.topic,
            topic.type,
            reliable=reliable and is_reliable(topic),
            durable=is_durable(topic),
            depth=topic.depth,
        )

    def _end(self, _signal: int, _frame: FrameType | None) -> NoReturn:
        with contextlib.suppress(RuntimeError):  # as a thread may change what is looked at
            self._look(last=True)
        os._exit(0)

    def _hear_bus(self) -> None:
        """Gives the graph what the bus has."""
        wanted: dict[tuple[int, int], list[Given]] = {}
        messages = self._session.messages
        for each in self._given:
            for name in () if is_picture(each.topic) else each.topic.bus:
                id_, stamp = messages.key(name)
                wanted.setdefault((id_, stamp or 0), []).append(each)
        self._session.hear_only({id_ for id_, _ in wanted})
        newest: dict[tuple[int, int], Any] = {}
        while True:
            envelope = self._session.receive(None)
            key = (envelope.data_type, envelope.sender_stamp) if envelope else (0, 0)
            if envelope is None or key not in wanted:
                continue
            try:
                newest[key] = messages.decode(envelope.data_type, envelope.payload)
            except MessageError as error:
                self._findings.say(Finding(f"a message of the bus is broken: {error}", ("bus", key), "warning"))
                continue
            for each in wanted[key]:
                self._feed(each, key, newest, envelope.sample_time)

    def _feed(self, given: Given, key: tuple[int, int], newest: Mapping[tuple[int, int], Any], time_us: int) -> None:
        """Publishes a topic when each of its messages has come again."""
        keys = {
            name.partition("/")[0]: (id_, stamp or 0)
            for name, (id_, stamp) in ((name, self._session.messages.key(name)) for name in given.topic.bus)
        }
        given.fresh |= {name for name, of in keys.items() if of == key}
        if given.fresh == keys.keys():
            given.fresh.clear()
            self._publish(given, {name: newest[of] for name, of in keys.items()}, time_us)

    def _publish(
        self, given: Given, messages: Mapping[str, Any], time_us: int, picture: CameraPicture | None = None
    ) -> None:
        if (not given.heard and not is_durable(given.topic)) or not given.is_due(time_us):
            return
        topic = given.topic
        try:
            data = self._types.encode(topic.type, self._types.given(topic, messages, time_us, picture))
        except RosTypeError as error:
            self._findings.say(Finding(str(error), ("given", topic.topic), "warning"))
            return
        if not given.writer.write(data):
            text = f"a reader of {topic.topic} takes nothing any more: its program hangs"
            self._findings.say(Finding(text, ("hangs", topic.topic), "warning"))

    def _show(self, name: str) -> None:
        """Gives the graph the pictures of a memory."""
        topics = [each for each in self._given if is_picture(each.topic) and each.topic.bus[0] == name]
        camera = next((each.topic.camera for each in topics if each.topic.camera), None)
        if camera is None:
            raise BridgeError(f"nothing says how large the pictures of {name} are")
        with _attached(self._names[name]) as memory:
            format_ = camera.format or name.rpartition(".")[2]
            if format_ not in _FORMATS.values() and format_ != "rgb":
                format_ = _FORMATS.get(memory.size / (camera.width * camera.height), "bgr")
            self._ready.wait(START_PATIENCE)
            while True:
                if not memory.wait():
                    continue
                with memory.lock():
                    data, time_us = bytes(memory.buffer), memory.sample_time()
                picture = CameraPicture.of(data, format_, camera.width, camera.height)
                for each in topics:
                    self._publish(each, {}, time_us, picture)

    def _give_time(self) -> None:
        """Each 10 ms while a node hears it, at full ones."""
        self._ready.wait(START_PATIENCE)
        while True:
            self._clock_heard.wait()
            now = now_us()
            time.sleep((CLOCK_STEP - now % CLOCK_STEP) / 1e6)
            now = now_us()
            self._clock.write(self._types.encode(CLOCK_TYPE, {"clock": _stamp(now - now % CLOCK_STEP)}))

    def _hear_graph(self) -> None:
        """Takes what the application sends, and looks at its graph."""
        looked = 0.0
        while True:
            self._graph.wait(_LOOK)
            self._graph.discover(self._seen)
            for given in self._given:
                given.heard = given.writer.readers
            (self._clock_heard.set if self._clock.readers else self._clock_heard.clear)()
            if not self._ready.is_set() and self._is_met():
                self._ready.set()
            for sent in self._sent:
                self._follow(sent)
                for data in sent.reader.take():
                    self._take(sent.topic, data)
            if time.monotonic() - looked >= _LOOK:
                looked = time.monotonic()
                self._look()

    def _is_met(self) -> bool:
        """Whether all nodes have come that discovery tells of, and the application's services have one each."""
        services = {name for names in self._topics.services.values() for name in names}
        if len(self._seen.participants) < max(1, len(services)):
            return False
        for each in self._given:
            own = Endpoint(b"", b"", each.topic.topic, each.topic.type, True, is_reliable(each.topic), True)
            if each.heard < sum(own.meets(other) for other in self._seen.of(each.topic.topic, False)):
                return False
        shown = {each.topic.bus[0] for each in self._given if each.heard and is_picture(each.topic)}
        return shown == self._names.keys()

    def _follow(self, sent: Sent) -> None:
        """Hears a topic by best effort when one of its publishers does no more."""
        if sent.reliable and not sent.topic.reliability:
            others = self._seen.of(sent.topic.topic, True)
            if not all(each.reliable for each in others):
                self._graph.drop(sent.reader)
                sent.reader, sent.reliable = self._reader(sent.topic, False), False

    def _take(self, topic: Topic, data: bytes) -> None:
        """Sends what a message of the application becomes."""
        now = now_us()
        if len(data) > _LARGEST_ANSWER:
            text = f"{topic.topic} has messages of more than {_LARGEST_ANSWER >> 20} MB, which are not taken"
            self._findings.say(Finding(text, ("large", topic.topic)))
            return
        try:
            fields = self._types.decode(topic.type, data)
            if self._types.has_header(topic.type):
                self._judge_header(topic, fields, now)
            for message in self._types.sent(topic, fields, now):
                made = self._session.messages.type(message.name)(**message.fields)
                self._session.send(made, message.sample_time, message.stamp)
        except (RosTypeError, MessageError, TypeError, ValueError) as error:
            text = f"sends on {topic.topic} is not taken: {error}"
            self._findings.say_later(("broken", topic.topic), lambda: f"what {self._node(topic)} {text}")

    def _judge_header(self, topic: Topic, fields: Mapping[str, Any], now: int) -> None:
        expected = topic.frame_id or FRAME_IDS.get(topic.type, "")
        frame, stamp = fields["header"]["frame_id"], time_of(fields)
        if findings.frame_problem(topic, "", frame, expected):
            key = ("frame", topic.topic)
            self._findings.say_later(key, lambda: findings.frame_problem(topic, self._node(topic), frame, expected))
        if findings.stamp_problem(topic, "", stamp, now):
            key = ("stamp", topic.topic)
            self._findings.say_later(key, lambda: findings.stamp_problem(topic, self._node(topic), stamp, now))

    def _node(self, topic: Topic, writes: bool = True) -> str:
        return " and ".join(sorted({self._seen.name(each) for each in self._seen.of(topic.topic, writes)})) or "a node"

    def _look(self, last: bool = False) -> None:
        now = time.monotonic()
        self._findings.look(now, last)
        for each in self._given:
            topic = each.topic
            loose = [reader for reader in self._seen.of(topic.topic, False) if not reader.reliable]
            if not is_picture(topic) or topic.camera is None or not loose:
                continue
            lost = self._lost() - self._lost_before
            self._lost_since = self._lost_since or (now if lost else 0.0)
            if lost and (last or now - self._lost_since >= _BETTER_LATE):
                size = topic.camera.width * topic.camera.height * 3
                node = " and ".join(sorted({self._seen.name(reader) for reader in loose}))
                text = findings.loss(topic, node, size, findings.receive_limit(), lost)
                self._findings.say(Finding(text, ("lost",)))

    @staticmethod
    def _lost() -> int:
        return findings.lost_datagrams(_own_sockets())


def now_us() -> int:
    return time.time_ns() // 1000


def _stamp(time_us: int) -> dict[str, int]:
    return {"sec": time_us // 10**6, "nanosec": time_us % 10**6 * 1000}


def _own_sockets() -> Iterable[int]:
    for each in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):
            if match := _SOCKET.fullmatch(str(each.readlink())):
                yield int(match[1])


def _attached(name: str) -> SharedMemory:
    """A memory that is there or comes soon; raises SharedMemoryError."""
    until = time.monotonic() + START_PATIENCE
    while True:
        try:
            return SharedMemory.attach(name)
        except SharedMemoryError:
            if time.monotonic() > until:
                raise
            time.sleep(0.05)


def _guarded(work: Callable[[], None]) -> None:
    """Ends the program with a sentence when a part of it cannot go on."""
    try:
        work()
    except (BridgeError, SharedMemoryError, PixelError, MessageError, RosTypeError) as error:
        _fail(str(error))
    except SessionError as error:
        _fail(f"the bus is lost: {error}")
    except OSError as error:
        _fail(f"the bus or the graph is lost: {error.strerror or error}")


def _fail(text: str) -> NoReturn:
    print(f"ros-bridge: {text}", file=sys.stderr, flush=True)
    os._exit(1)
