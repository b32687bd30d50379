"""The ROS topics of a test: what each is made of, or becomes, and what is wrong with that.

A topic with its type is enough where only one source fits. What a test does not have is a warning, as the same
application runs in others; what could mean several things is an error.
"""

import functools
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dodo_dsl.application.model import Declared
from dodo_dsl.application.ros_topics import RosTopic
from dodo_dsl.diagnostics import Diagnostic, did_you_mean, listed
from dodo_dsl.opendlv.assets import recording_contents
from dodo_dsl.opendlv.pixels import FORMATS
from dodo_dsl.opendlv.ros_types import (
    CLOCK,
    FRAME_IDS,
    GIVEN,
    MEMORY,
    NUMBERS,
    SENT,
    STATIC_FRAMES,
    CameraView,
    StaticFrame,
    Topic,
)
from dodo_dsl.spec.arguments import ResolvedService

_ROBOT = "base_link"
_PICTURES = ("argb", "bgr", "rgb")
"""Formats of memories of which topics are made, the best first: every camera has the first."""
_OWN = (CLOCK, "/tf", STATIC_FRAMES)
_DETECTIONS = "vision_msgs/msg/Detection2DArray"


@dataclass(frozen=True)
class Resolved:
    """A topic of a service of the application, with what it is made of or becomes; ``bus`` is empty without any."""

    service: str
    written: RosTopic
    bus: tuple[str, ...] = ()
    camera: ResolvedService | None = None
    problems: tuple[Diagnostic, ...] = ()

    @property
    def is_picture(self) -> bool:
        return self.written.given and (MEMORY,) in GIVEN.get(self.written.type, ())


@dataclass(frozen=True)
class Sources:
    """What the services of a test make: memories and messages, each with the service; ``own`` are the team's types."""

    services: Sequence[ResolvedService]
    memories: tuple[tuple[str, str], ...] = ()
    messages: tuple[tuple[str, str], ...] = ()
    own: Mapping[str, Collection[str]] = field(default_factory=dict)

    def resolve(self, declared: Mapping[str, Declared | None]) -> tuple[Resolved, ...]:
        """All topics of an application."""
        topics = [(name, topic) for name, each in declared.items() if each for topic in each.topics]
        return tuple(self._resolved(name, topic) for name, topic in topics)

    def _resolved(self, service: str, topic: RosTopic) -> Resolved:
        if problem := self._of_name(topic) or self._of_type(topic):
            return Resolved(service, topic, problems=(problem,))
        if not topic.given:
            return Resolved(service, topic, tuple(name for name, _ in topic.messages), self._seen(topic))
        if (MEMORY,) in GIVEN.get(topic.type, ()):
            return self._picture(service, topic)
        return self._message(service, topic)

    def _of_name(self, topic: RosTopic) -> Diagnostic | None:
        if topic.name not in _OWN:
            return None
        what = "is always there" if topic.name == CLOCK else "has the frames of sensors, and no other ones"
        return Diagnostic(topic.span, "ros-topic", f"'{topic.name}' {what}", "remove it")

    def _of_type(self, topic: RosTopic) -> Diagnostic | None:
        known = [*(GIVEN if topic.given else SENT), *NUMBERS, *self.own]
        if topic.type not in known:
            does = "makes" if topic.given else "takes"
            other = SENT if topic.given else GIVEN
            hint = f"write it under '{'out' if topic.given else 'in'}'" if topic.type in other else ""
            hint = hint or did_you_mean(topic.type, known) or f"known: {', '.join(known)}; own ones in 'messages'"
            return Diagnostic(topic.type_span, "ros-type", f"DoDo {does} no topics of type '{topic.type}'", hint)
        if topic.ports or topic.type in (GIVEN if topic.given else SENT):
            return None
        key, example = ("from", "VoltageReading/0") if topic.given else ("to", "PedalPositionRequest/0")
        hint = f"write {topic.name}: {{type: {topic.type}, {key}: opendlv.proxy.{example}}}"
        message = f"'{topic.name}' does not say which message it {'is made of' if topic.given else 'becomes'}"
        return Diagnostic(topic.span, "ros-topic", message, hint)

    def _seen(self, topic: RosTopic) -> ResolvedService | None:
        """The camera whose pixels detections count: the test's only one."""
        makers = {name for _, name in self.memories} if topic.type == _DETECTIONS else set()
        return self._service(makers.pop()) if len(makers) == 1 else None

    def _service(self, name: str) -> ResolvedService | None:
        return next((service for service in self.services if service.use.name == name), None)

    def _picture(self, service: str, topic: RosTopic) -> Resolved:
        chosen = [(memory, maker) for memory, maker in self.memories if self._is_meant(topic, memory, maker)]
        makers = sorted({maker for _, maker in chosen})
        if not chosen:
            return Resolved(service, topic, problems=(self._without_source(topic, "pictures", self.memories),))
        if len(makers) > 1:
            return Resolved(service, topic, problems=(_ambiguous(topic, makers),))
        camera = self._service(makers[0])
        formats = {_format(memory, camera): memory for memory, _ in reversed(chosen)}
        best = next((formats[each] for each in _PICTURES if each in formats), None)
        if best is None:
            message = f"'{topic.name}' is made of {chosen[0][0]}, expected a memory of {' or '.join(_PICTURES)}"
            return Resolved(service, topic, problems=(Diagnostic(topic.span, "ros-topic", message),))
        found = []
        if topic.type.endswith("/CameraInfo") and camera and not camera.texts.get("fovy"):
            message = f"'{topic.name}' has no source: '{makers[0]}' does not know its camera's opening angle"
            found.append(Diagnostic(topic.span, "ros-topic", message, severity="warning"))
        return Resolved(service, topic, () if found else (best,), camera, tuple(found))

    @staticmethod
    def _is_meant(topic: RosTopic, name: str, maker: str) -> bool:
        """Whether ``from`` means a source, by its name, that without format or stamp, or its service's."""
        stem = name.rpartition(".")[0] if maker and "/" not in name and name.rpartition(".")[2] in FORMATS else ""
        meant = {name, name.removesuffix("/0"), maker, stem, name.partition("/")[0]}
        return not topic.ports or any(word in meant for word, _ in topic.ports)

    def _message(self, service: str, topic: RosTopic) -> Resolved:
        words = {word.partition("/")[0] for word, _ in topic.ports if "." in word}
        for names in GIVEN.get(topic.type) or (tuple(sorted(words)),):
            found = [
                [(port, maker) for port, maker in self.messages if port.partition("/")[0] == name] for name in names
            ]
            found = [[one for one in each if self._is_meant(topic, *one)] for each in found]
            if not all(found):
                continue
            for each in found:
                if len(each) > 1:
                    return Resolved(service, topic, problems=(_ambiguous(topic, [port for port, _ in each]),))
            return Resolved(service, topic, tuple(each[0][0] for each in found))
        ways = [" with ".join(names) for names in GIVEN.get(topic.type, ())] or sorted(words)
        return Resolved(service, topic, problems=(self._without_source(topic, " or ".join(ways), self.messages),))

    def _without_source(self, topic: RosTopic, what: str, made: Sequence[tuple[str, str]]) -> Diagnostic:
        if topic.ports and (wanted := {topic.ports[0][0]}) and made:
            (word,) = wanted
            names = sorted({name for pair in made for name in pair})
            message = f"'{topic.name}' is made of '{word}', which the test does not have"
            hint = did_you_mean(word, names) or f"the test has {listed(names[:8])}"
            if what == "pictures":
                hint += "; without 'from' it is the test's only camera"
            return Diagnostic(topic.ports[0][1], "ros-source", message, hint, "warning")
        message = f"'{topic.name}' has no source: no service of the test makes {what}"
        return Diagnostic(topic.span, "ros-source", message, severity="warning")


def _ambiguous(topic: RosTopic, names: Sequence[str]) -> Diagnostic:
    message = f"'{topic.name}' could be made of {listed([f'{name!r}' for name in names])}"
    hint = f"write {topic.name}: {{type: {topic.type}, from: {names[0]}}}"
    return Diagnostic(topic.span, "ros-source", message, hint)


def _format(memory: str, camera: ResolvedService | None) -> str:
    """The format of a memory, by the parameter that names it."""
    named = (key for key, text in (camera.texts if camera else {}).items() if text == memory)
    return next((key.removeprefix("name.") for key in named if key.startswith("name.")), memory.rpartition(".")[2])


def problems(topics: Iterable[Resolved]) -> Iterator[Diagnostic]:
    """What is wrong with topics, each and together."""
    types: dict[str, Resolved] = {}
    sent: dict[str, Resolved] = {}
    for each in topics:
        yield from each.problems
        topic = each.written
        other = types.setdefault(topic.name, each)
        if other.written.type != topic.type:
            message = f"'{topic.name}' has two types: '{other.service}' has {other.written.type}"
            yield Diagnostic(topic.type_span, "ros-topic", message, "a topic has one type in ROS")
        elif other is not each and not topic.given and not other.written.given:
            message = f"'{other.service}' and '{each.service}' both publish '{topic.name}'"
            yield Diagnostic(topic.span, "ros-topic", message, "give one of them another topic", "warning")
        for name in () if topic.given else each.bus:
            before = sent.setdefault(name, each)
            if before.written.name != topic.name:
                message = f"'{before.written.name}' and '{topic.name}' both become {name}"
                yield Diagnostic(topic.span, "ros-topic", message, "remove one, or give it another message with 'to'")


def wanted(topics: Iterable[Resolved], problem: Diagnostic) -> Iterator[str]:
    """The messages of which a topic without a source could be made."""
    for each in topics:
        if problem in each.problems and problem.rule == "ros-source":
            yield from (name for names in GIVEN.get(each.written.type, ()) for name in names)


def by_topic(resolved: Iterable[Resolved]) -> dict[str, tuple[str, ...]]:
    """The services of each topic."""
    found: dict[str, tuple[str, ...]] = {}
    for each in resolved:
        found[each.written.name] = (*found.get(each.written.name, ()), each.service)
    return found


def topics(resolved: Iterable[Resolved]) -> Iterator[Topic]:
    """The topics that a test has, each once."""
    for each in {each.written.name: each for each in resolved if each.bus and not each.problems}.values():
        topic = each.written
        yield Topic(
            topic=topic.name,
            type=topic.type,
            bus=each.bus,
            encoding=topic.encoding,
            frame_id=topic.frame_id or (FRAME_IDS.get(topic.type, "") if topic.given else ""),
            reliability=topic.reliability,
            durability=topic.durability,
            depth=topic.depth,
            rate=topic.rate,
            fields=dict(topic.fields),
            camera=_view(each),
        )


def _view(topic: Resolved) -> CameraView | None:
    texts = topic.camera.texts if topic.camera else {}
    size = int(texts.get("width", 0)), int(texts.get("height", 0))
    if topic.camera and not all(size):
        played = (
            a.value.path for a in topic.camera.arguments.values() if a.parameter.format == "recording" and a.value
        )
        size = next((recorded_size(path) for path in played if path), size)
    if topic.camera is None:
        return None
    format_ = _format(topic.bus[0], topic.camera) if topic.is_picture else ""
    return CameraView(width=size[0], height=size[1], fovy=float(texts.get("fovy", 0)), format=format_)


@functools.lru_cache(maxsize=64)
def recorded_size(path: Path) -> tuple[int, int]:
    """Width and height of a recording's first picture; 0 without any, or if it cannot be read."""
    return recording_contents.picture_size(path)


def frames(resolved: Iterable[Resolved], services: Sequence[ResolvedService]) -> Iterator[StaticFrame]:
    """Where the sensors of topics stand on the robot, each frame once."""
    known: dict[str, StaticFrame] = {}
    for each in resolved:
        topic = each.written
        if not (topic.given and each.bus) or each.problems:
            continue
        child = topic.frame_id or FRAME_IDS.get(topic.type, "")
        maker = each.camera or _maker(each.bus[0], services)
        if child in ("", _ROBOT, "odom", "map") or maker is None:
            continue
        place = {key: _first(maker.texts.get(key)) for key in ("x", "y", "z")}
        roll, pitch, yaw = (math.radians(_first(maker.texts.get(key))) for key in ("roll", "pitch", "yaw"))
        angles = {"roll": roll, "pitch": 0.0 - pitch, "yaw": yaw}  # pitch is positive downwards in REP 103
        if each.is_picture:
            body = child.removesuffix("_optical_frame") + "_link"
            known.setdefault(body, StaticFrame(parent=_ROBOT, child=body, **place, **angles))
            known.setdefault(child, StaticFrame(parent=body, child=child, roll=-math.pi / 2, yaw=-math.pi / 2))
        else:
            known.setdefault(child, StaticFrame(parent=_ROBOT, child=child, **place, **angles))
    yield from known.values()


def _maker(port: str, services: Sequence[ResolvedService]) -> ResolvedService | None:
    name = port.partition("/")[0]
    return next((each for each in services if any(name in out for out in each.messages.outputs)), None)


def _first(text: str | None) -> float:
    """The number, or the first of a list."""
    try:
        return float((text or "0").split(",")[0])
    except ValueError:
        return 0.0
