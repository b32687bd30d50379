"""Between the test's bus and shared memories and the application's ROS graph.

One thread takes messages of the bus, one each a memory's pictures, one what the graph sends, and one gives the time.
The bridge has the application's clock, so that its times are those of frames and messages.
"""

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

from dodo_dsl.opendlv import ros_types
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.pixels import PixelError, view
from dodo_dsl.opendlv.ros_codec import RosTypeError
from dodo_dsl.opendlv.ros_messages import Types, stamp_of, time_of
from dodo_dsl.opendlv.ros_pictures import CameraPicture
from dodo_dsl.opendlv.ros_types import CLOCK, CLOCK_TYPE, FRAME_IDS, RosGraph, Topic
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError
from services.ros_bridge.findings import Finding, Findings, end_of, frame_problem, loss, lost_datagrams, stamp_problem
from services.ros_bridge.graph import BridgeError, Endpoint, Graph, taken, write

_ENDS = {signal.SIGTERM, signal.SIGINT}
START_PATIENCE = 5.0
"""Seconds for which the first picture and the first time wait for nodes that are to hear them."""
CLOCK_STEP = 10_000
LOOK = 1.0


@dataclass
class Given:
    """A topic that the application gets, and how many hear it; ``parts`` are the ids and senders of its messages."""

    topic: Topic
    writer: Any
    parts: dict[str, tuple[int, int]]
    heard: int = 0
    fresh: set[tuple[int, int]] = field(default_factory=set)
    last: int | None = None


@dataclass
class Sent:
    topic: Topic
    reader: Any
    reliable: bool = True


def is_picture(topic: Topic) -> bool:
    return ros_types.GIVEN.get(topic.type) == ((ros_types.MEMORY,),)


def definitions(graph: RosGraph, folder: Path) -> tuple[MessageSet, list[Path]]:
    """The messages of a graph's bus, and files with its own types, which are written into a folder."""
    texts = {**graph.types, **({"own.odvd": graph.messages} if graph.messages else {})}
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return MessageSet.load(*[folder / "own.odvd"][: bool(graph.messages)]), [folder / name for name in graph.types]


class Bridge:
    """Connects what was made for it; ``run`` never returns."""

    def __init__(self, cid: int, topics: RosGraph, folder: Path, names: Sequence[str] = ()) -> None:
        """``names`` are those of the memories as they are, where they differ; ``folder`` is a scratch one."""
        messages, types = definitions(topics, folder)
        memories = tuple(dict.fromkeys(topic.bus[0] for topic in topics.given if is_picture(topic)))
        if names and len(names) != len(memories):
            raise BridgeError(f"--name is given {len(names)} times for {len(memories)} memories {', '.join(memories)}")
        self._names = dict(zip(memories, names or memories, strict=True))
        self._topics, self._types = topics, Types(types, messages)
        for topic in (*topics.given, *topics.sent):
            self._types.check(topic)
        self._session, self._graph = Session(cid, messages), Graph(self._types)
        self._seen = self._graph.seen
        self._findings = Findings(topics, self._seen)
        self._ready, self._clock_heard = threading.Event(), threading.Event()
        self._clock = self._graph.writer(Endpoint(b"", CLOCK, CLOCK_TYPE, True), 1)
        self._given = [self._giving(topic) for topic in topics.given]
        self._sent = [Sent(topic, self._graph.reader(end_of(topic, False), topic.depth)) for topic in topics.sent]
        if topics.frames:
            name, type_ = ros_types.STATIC_FRAMES, ros_types.STATIC_FRAMES_TYPE
            self._frames = self._graph.writer(Endpoint(b"", name, type_, True, durable=True), 1)
            write(self._frames, self._types.encode(type_, self._types.frames(topics.frames, now_us())))
        self._lost_before, self._losing = lost_datagrams(), 0

    def run(self) -> NoReturn:
        """Until SIGTERM ends it, or the bus or a memory is lost."""
        for number in _ENDS:
            signal.signal(number, self._end)
        signal.pthread_sigmask(signal.SIG_BLOCK, _ENDS)  # this thread alone takes them, also when it waits for its turn
        for work in (self._hear_graph, self._give_time, *(partial(self._show, name) for name in self._names)):
            threading.Thread(target=_guarded, args=(work,), daemon=True).start()
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDS)
        _guarded(self._hear_bus)
        raise AssertionError

    def _end(self, _signal: int, _frame: FrameType | None) -> NoReturn:
        with contextlib.suppress(RuntimeError):  # as a thread may change what is looked at
            self._look(last=True)
        os._exit(0)

    def _giving(self, topic: Topic) -> Given:
        names = () if is_picture(topic) else topic.bus
        keys = ((name.partition("/")[0], *self._session.messages.key(name)) for name in names)
        writer = self._graph.writer(end_of(topic, True), topic.depth)
        return Given(topic, writer, {name: (id_, stamp or 0) for name, id_, stamp in keys})

    def _hear_bus(self) -> None:
        """Publishes a topic when each of its messages has come again."""
        messages = self._session.messages
        wanted = {key for given in self._given for key in given.parts.values()}
        self._session.hear_only({id_ for id_, _ in wanted})
        newest: dict[tuple[int, int], Any] = {}
        while True:
            envelope = self._session.receive(None)
            if envelope is None or (key := (envelope.data_type, envelope.sender_stamp)) not in wanted:
                continue
            try:
                newest[key] = messages.decode(envelope.data_type, envelope.payload)
            except MessageError as error:
                self._findings.say(Finding(("bus", key), f"a message of the bus is broken: {error}", "warning"))
                continue
            for given in self._given:
                if key in given.parts.values():
                    given.fresh.add(key)
                    if given.fresh == set(given.parts.values()):
                        given.fresh.clear()
                        parts = {name: newest[part] for name, part in given.parts.items()}
                        self._publish(given, parts, envelope.sample_time)

    def _publish(
        self, given: Given, messages: Mapping[str, Any], time_us: int, picture: CameraPicture | None = None
    ) -> None:
        topic = given.topic
        is_early = topic.rate and given.last is not None and time_us - given.last < 1e6 / topic.rate - 1000
        if is_early or not (given.heard or end_of(topic, True).durable):
            return
        given.last = time_us
        try:
            data = self._types.encode(topic.type, self._types.given(topic, messages, time_us, picture))
        except ValueError as error:
            self._findings.say(Finding(("given", topic.topic), str(error), "warning"))
            return
        if not write(given.writer, data):
            text = f"a reader of {topic.topic} takes nothing any more: its program hangs"
            self._findings.say(Finding(("hangs", topic.topic), text, "warning"))

    def _show(self, name: str) -> None:
        topics = [given for given in self._given if is_picture(given.topic) and given.topic.bus[0] == name]
        camera = next((given.topic.camera for given in topics if given.topic.camera), None)
        if camera is None:
            raise BridgeError(f"nothing says how large the pictures of {name} are")
        with SharedMemory.attach(self._names[name]) as memory:
            self._ready.wait(START_PATIENCE)
            while True:
                if memory.wait():
                    with memory.lock():
                        data, time_us = bytes(memory.buffer), memory.sample_time()
                    format_ = camera.format or name.rpartition(".")[2]
                    picture = CameraPicture(view(data, format_, camera.width, camera.height), format_)
                    for given in topics:
                        self._publish(given, {}, time_us, picture)

    def _give_time(self) -> None:
        """Each 10 ms while a node hears it."""
        self._ready.wait(START_PATIENCE)
        while True:
            self._clock_heard.wait()
            time.sleep((CLOCK_STEP - now_us() % CLOCK_STEP) / 1e6)
            now = now_us()
            write(self._clock, self._types.encode(CLOCK_TYPE, {"clock": stamp_of(now - now % CLOCK_STEP)}))

    def _hear_graph(self) -> None:
        looked = 0.0
        while True:
            self._graph.wait(LOOK)
            for given in self._given:
                given.heard = given.writer.get_publication_matched_status().current_count
            is_heard = self._clock.get_publication_matched_status().current_count
            (self._clock_heard.set if is_heard else self._clock_heard.clear)()
            if not self._ready.is_set() and self._is_met():
                self._ready.set()
            for sent in self._sent:
                if sent.reliable and not sent.topic.reliability:  # it follows its writers
                    sent.reliable = all(each.reliable for each in self._seen.of(sent.topic.topic, True))
                    if not sent.reliable:
                        self._graph.drop(sent.reader)
                        own = replace(end_of(sent.topic, False), reliable=False)
                        sent.reader = self._graph.reader(own, sent.topic.depth)
                for data in taken(sent.reader):
                    self._take(sent.topic, data)
            if time.monotonic() - looked >= LOOK:
                looked = time.monotonic()
                self._look()

    def _is_met(self) -> bool:
        """Whether all readers are met that were discovered, and the application's services have a program each."""
        services = {name for names in self._topics.services.values() for name in names}
        shown = {given.topic.bus[0] for given in self._given if given.heard and is_picture(given.topic)}
        for given in self._given:
            own, readers = end_of(given.topic, True), self._seen.of(given.topic.topic, False)
            if given.heard < sum(own.type == reader.type and not own.lacks(reader) for reader in readers):
                return False
        return shown == self._names.keys() and len(self._seen.participants) >= max(1, len(services))

    def _take(self, topic: Topic, data: bytes) -> None:
        now = now_us()
        try:
            fields = self._types.decode(topic.type, data)
            if self._types.has_header(topic.type):
                expected = topic.frame_id or FRAME_IDS.get(topic.type, "")
                problem = frame_problem(topic, fields["header"]["frame_id"], expected)
                self._findings.say_later("frame", topic, problem)
                if problem and topic.frame_id:  # where it is asked for, another one means something else
                    return
                self._findings.say_later("stamp", topic, stamp_problem(topic, time_of(fields), now))
            for message in self._types.sent(topic, fields, now):
                self._session.send(*message)
        except (TypeError, ValueError) as error:
            self._findings.say_later("broken", topic, f"a message on {topic.topic} is not taken: {error}")

    def _look(self, last: bool = False) -> None:
        self._findings.look(time.monotonic(), last)
        for topic in (given.topic for given in self._given if is_picture(given.topic) and given.topic.camera):
            readers = [each for each in self._seen.of(topic.topic, False) if not each.reliable]
            if readers and (lost := lost_datagrams() - self._lost_before) > 0:
                self._losing += 1
                if last or self._losing > START_PATIENCE:
                    size = topic.camera.width * topic.camera.height * 3 if topic.camera else 0
                    self._findings.say(Finding(("lost",), loss(topic, self._seen.name(*readers), size, lost)))


def now_us() -> int:
    return time.time_ns() // 1000


def _guarded(work: Callable[[], None]) -> None:
    """Ends the program with a sentence when a part of it cannot go on."""
    try:
        work()
    except (BridgeError, SharedMemoryError, PixelError, RosTypeError) as error:
        text = str(error)
    except Exception as error:  # noqa: BLE001 - whatever it is, no other part can go on
        text = f"the bus or the graph is lost ({type(error).__name__}: {error})"
    print(f"ros-bridge: {text}", file=sys.stderr, flush=True)
    os._exit(1)
