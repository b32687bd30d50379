"""The ROS topics of a test: what each is made of, or becomes, and what is wrong with that.

A topic with its type is enough where only one source fits. What a test does not have is a warning, as the same
application runs in others; what could mean several things is an error.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import msgspec

from dodo_dsl.application.model import Declared
from dodo_dsl.application.ros_topics import RosTopic
from dodo_dsl.diagnostics import Diagnostic, Severity, did_you_mean, listed
from dodo_dsl.opendlv.assets import recording_contents
from dodo_dsl.opendlv.ros_types import (
    CLOCK,
    FRAME_IDS,
    GIVEN,
    MEMORY,
    NUMBERS,
    SENT,
    STATIC_FRAMES,
    CameraView,
    RosGraph,
    StaticFrame,
    Topic,
)
from dodo_dsl.spec.arguments import ResolvedService

_ROBOT = "base_link"
_PICTURES = ("argb", "bgr", "rgb")
"""Formats of memories of which topics are made, the best first: every camera has the first."""
_OWN = {CLOCK: "is always there", **dict.fromkeys(("/tf", STATIC_FRAMES), "has the frames of sensors, and no others")}


@dataclass(frozen=True)
class Resolved:
    """A topic of a service of the application, with what it is made of or becomes, ``bus``; empty without any.

    ``maker`` is the service that makes it, or the camera whose pixels it counts.
    """

    service: str
    written: RosTopic
    bus: tuple[str, ...] = ()
    maker: ResolvedService | None = None
    problem: Diagnostic | None = None

    @property
    def is_picture(self) -> bool:
        return self.written.given and (MEMORY,) in GIVEN.get(self.written.topic.type, ())

    def refused(self, rule: str, message: str, hint: str = "", severity: Severity = "error") -> "Resolved":
        """The same with a problem; that of a type is at its place."""
        span = self.written.type_span if rule == "ros-type" else self.written.span
        return replace(self, problem=Diagnostic(span, rule, f"'{self.written.topic.topic}' {message}", hint, severity))


@dataclass(frozen=True)
class Sources:
    """What the services of a test make: memories and messages, each with the service; ``own`` are the team's types."""

    services: Sequence[ResolvedService]
    memories: tuple[tuple[str, str], ...] = ()
    messages: tuple[tuple[str, str], ...] = ()
    own: Mapping[str, Collection[str]] = field(default_factory=dict)

    def resolve(self, declared: Mapping[str, Declared | None]) -> tuple[Resolved, ...]:
        topics = [Resolved(name, topic) for name, each in declared.items() if each for topic in each.topics]
        found = tuple(map(self._resolved, topics))
        seen = {each.maker.use.name: each.maker for each in found if each.is_picture and each.maker}
        return tuple(self._of_camera(each, [*seen.values()]) for each in found)

    def _of_camera(self, it: Resolved, seen: Sequence[ResolvedService]) -> Resolved:
        """Detections with the camera whose pixels they count: the test's only one, or the only one that nodes see."""
        cameras = {maker for _, maker in self.memories}
        if it.written.given or it.problem or "/Detection" not in it.written.topic.type or not cameras:
            return it
        if len(cameras) > 1 and len(seen) != 1:
            return it.refused("ros-source", f"could count pixels of {listed(sorted(cameras))}", "give nodes one")
        return replace(it, maker=seen[0] if len(cameras) > 1 else self._service(cameras.pop()))

    def _resolved(self, it: Resolved) -> Resolved:
        written, topic = it.written, it.written.topic
        here, there = (GIVEN, SENT) if written.given else (SENT, GIVEN)
        known = [*here, *NUMBERS, *self.own]
        if topic.topic in _OWN:
            return it.refused("ros-topic", _OWN[topic.topic], "remove it")
        if topic.type not in known:
            hint = f"write it under '{'out' if written.given else 'in'}'" if topic.type in there else ""
            hint = hint or did_you_mean(topic.type, known) or f"known: {', '.join(known)}; own ones in 'messages'"
            does = "make" if written.given else "take"
            return it.refused("ros-type", f"has the type '{topic.type}', of which DoDo {does}s no topics", hint)
        if not written.ports and topic.type not in here:
            key, example = ("from", "VoltageReading/0") if written.given else ("to", "PedalPositionRequest/0")
            hint = f"write {topic.topic}: {{type: {topic.type}, {key}: opendlv.proxy.{example}}}"
            is_made = "is made of" if written.given else "becomes"
            return it.refused("ros-topic", f"does not say which message it {is_made}", hint)
        missing = {path.partition(".")[0] for path in topic.fields.values()} - {*self.own.get(topic.type, ())}
        if topic.type in self.own and missing:
            hint = f"it has {', '.join(self.own[topic.type])}"
            return it.refused("ros-topic", f"names the field '{min(missing)}', which {topic.type} has not", hint)
        if not written.given:
            return replace(it, bus=tuple(name for name, _ in written.messages))
        return self._picture(it) if it.is_picture else self._message(it)

    def _service(self, name: str) -> ResolvedService | None:
        return next((service for service in self.services if service.use.name == name), None)

    def _picture(self, it: Resolved) -> Resolved:
        chosen = [(memory, maker) for memory, maker in self.memories if _is_meant(it, memory, maker)]
        makers = sorted({maker for _, maker in chosen})
        if not chosen:
            return _without_source(it, "pictures", self.memories)
        if len(makers) > 1:
            return _ambiguous(it, makers)
        camera = self._service(makers[0])
        formats = {_format(memory, camera): memory for memory, _ in reversed(chosen)}
        best = next((formats[each] for each in _PICTURES if each in formats), None)
        if best is None:
            return it.refused("ros-source", f"is made of {chosen[0][0]}, expected a memory of {listed(_PICTURES)}")
        if it.written.topic.type.endswith("/CameraInfo") and camera and not camera.texts.get("fovy"):
            why = f"has no source: '{makers[0]}' does not know its camera's opening angle"
            return it.refused("ros-source", why, severity="warning")
        return replace(it, bus=(best,), maker=camera)

    def _message(self, it: Resolved) -> Resolved:
        own = tuple(sorted({word.partition("/")[0] for word, _ in it.written.ports if "." in word}))
        if not (ways := GIVEN.get(it.written.topic.type) or (own,) * bool(own)):
            hint = "write the name of a message in 'from', such as opendlv.proxy.VoltageReading/0"
            return it.refused("ros-topic", "does not say which message it is made of", hint)
        for names in ways:
            meant = [(port, maker) for port, maker in self.messages if _is_meant(it, port, maker)]
            found = [[one for one in meant if one[0].partition("/")[0] == name] for name in names]
            if all(found):
                several = next((each for each in found if len(each) > 1), None)
                made = replace(it, bus=tuple(each[0][0] for each in found), maker=self._service(found[0][0][1]))
                return _ambiguous(it, [port for port, _ in several]) if several else made
        if any(port.partition("/")[0] == "*" for port, _ in self.messages):  # of a recording
            asked = {word.partition("/")[0]: word for word, _ in it.written.ports}
            return replace(it, bus=tuple(asked.get(name, f"{name}/0") for name in ways[0]))
        return _without_source(it, " or ".join(" with ".join(names) for names in ways), self.messages)


def _is_meant(it: Resolved, name: str, maker: str) -> bool:
    """Whether ``from`` means a source, by its name, that without format or stamp, or its service's."""
    meant = {name, maker, name.partition("/")[0], name.removesuffix("/0")}
    meant |= {name.rpartition(".")[0]} if it.is_picture else set()
    return not it.written.ports or any(word in meant for word, _ in it.written.ports)


def _without_source(it: Resolved, what: str, made: Sequence[tuple[str, str]]) -> Resolved:
    if not it.written.ports or not made:
        return it.refused("ros-source", f"has no source: no service of the test makes {what}", severity="warning")
    word, span = it.written.ports[0]
    names = sorted({name for pair in made for name in pair})
    hint = did_you_mean(word, names) or f"the test has {listed(names[:8])}"
    hint += "; without 'from' it is the test's only camera" if it.is_picture else ""
    found = it.refused("ros-source", f"is made of '{word}', which the test does not have", hint, "warning")
    return replace(found, problem=found.problem and replace(found.problem, span=span))


def _ambiguous(it: Resolved, names: Sequence[str]) -> Resolved:
    topic = it.written.topic
    hint = f"write {topic.topic}: {{type: {topic.type}, from: {names[0]}}}"
    return it.refused("ros-source", f"could be made of {listed([f'{name!r}' for name in names])}", hint)


def _format(memory: str, camera: ResolvedService | None) -> str:
    named = (key for key, text in (camera.texts if camera else {}).items() if text == memory)
    return next((key.removeprefix("name.") for key in named if key.startswith("name.")), memory.rpartition(".")[2])


def problems(topics: Iterable[Resolved]) -> Iterator[Diagnostic]:
    first: dict[str, Resolved] = {}
    sent: dict[str, str] = {}
    for each in topics:
        given, topic = each.written.given, each.written.topic
        other = first.setdefault(topic.topic, each)
        found = [each]
        is_same = (given, topic) == (other.written.given, other.written.topic)
        if not is_same or (each.bus != other.bus and not (each.problem or other.problem)):
            why = f"is another one at '{other.service}'"
            found.append(each.refused("ros-topic", why, "write the same type and keys, in one of 'in' and 'out'"))
        for name in () if given else each.bus:
            if (before := sent.setdefault(name.removesuffix("/0"), topic.topic)) != topic.topic:
                hint = "remove one, or give it another message with 'to'"
                found.append(each.refused("ros-topic", f"and '{before}' both become {name}", hint))
        yield from (one.problem for one in found if one.problem)


def graph(resolved: Sequence[Resolved]) -> RosGraph:
    known = {each.written.topic.topic: each for each in resolved if each.bus and not each.problem}
    services: dict[str, tuple[str, ...]] = {}
    for each in resolved:
        services[each.written.topic.topic] = (*services.get(each.written.topic.topic, ()), each.service)
    return RosGraph(
        given=tuple(_topic(each) for each in known.values() if each.written.given),
        sent=tuple(_topic(each) for each in known.values() if not each.written.given),
        frames=tuple(_frames(known.values())),
        services=services,
    )


def _topic(each: Resolved) -> Topic:
    frame_id = each.written.topic.frame_id or (FRAME_IDS.get(each.written.topic.type, "") if each.written.given else "")
    return msgspec.structs.replace(each.written.topic, bus=each.bus, frame_id=frame_id, camera=_view(each))


def _view(each: Resolved) -> CameraView | None:
    if each.maker is None or (each.written.given and not each.is_picture):
        return None
    texts, arguments = each.maker.texts, each.maker.arguments.values()
    size = int(texts.get("width", 0)), int(texts.get("height", 0))
    played = (a.value.path for a in arguments if a.parameter.format == "recording" and a.value and a.value.path)
    width, height = size if all(size) else next(map(recording_contents.picture_size, played), size)
    format_ = _format(each.bus[0], each.maker) if each.is_picture else ""
    return CameraView(width=width, height=height, fovy=float(texts.get("fovy", 0)), format=format_)


def _frames(resolved: Iterable[Resolved]) -> Iterator[StaticFrame]:
    """Where the sensors of topics stand on the robot, each frame once."""
    seen = {"", _ROBOT, "odom", "map"}
    for each in resolved:
        child = _topic(each).frame_id
        if not each.written.given or child in seen or each.maker is None:
            continue
        seen.add(child)
        texts = each.maker.texts
        place = {key: _of_sensor(texts, key, each) for key in ("x", "y", "z")}
        roll, pitch, yaw = (math.radians(_of_sensor(texts, key, each)) for key in ("roll", "pitch", "yaw"))
        body = child.removesuffix("_optical_frame") + "_link" if each.is_picture else child
        if each.is_picture:
            pitch = 0.0 - pitch  # a camera's is positive upwards, in REP 103 downwards
        yield StaticFrame(parent=_ROBOT, child=body, **place, roll=roll, pitch=pitch, yaw=yaw)
        if each.is_picture:
            yield StaticFrame(parent=body, child=child, roll=-math.pi / 2, yaw=-math.pi / 2)


def _of_sensor(texts: Mapping[str, str], key: str, of: Resolved) -> float:
    """A number of a service that may have several sensors: one for all of them, or one each by their sender stamps."""
    values, stamps = texts.get(key, "0").split(","), texts.get("id", "").split(",")
    stamp = of.bus[0].rpartition("/")[2]
    return float(values[stamps.index(stamp) if len(values) > 1 and stamp in stamps else 0])
