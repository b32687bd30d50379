"""Instances resolved once for rules, planner and ``dodo explain``: arguments, wiring, and what recordings send.

Services that play recordings send messages by their parameters, by what the recordings hold, and by whose it is. A
recording of a drive holds what the application of that drive sent. What the application of a test sends itself, and
is judged by, is left out of what is played: it would be taken for the application's.
"""

import functools
import operator
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from dodo_dsl.application.model import ApplicationSource, Declared
from dodo_dsl.check.wiring import ANYTHING, Port, Wiring, driving, message, wire
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.opendlv import odvd
from dodo_dsl.opendlv.assets import recording_contents
from dodo_dsl.opendlv.odvd import STANDARD_0_9
from dodo_dsl.source import Scalar
from dodo_dsl.spec.arguments import FRAME, Argument, Known, ResolvedService, resolved
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.rig import KIND_TAGS, Rig, emulated

FORMAT = "recording"
ONLY, WITHOUT = "messages", "without"
"""Parameters of messages that are played alone, and that are left out."""
IMAGE = "opendlv.proxy.ImageReading"
_NO_STAMP = -1
EULER = "euler"
"""Parameter with which a service sends frames also in the form of message set 0.9."""
_REQUEST = "Request"
"""How messages are called that ask an actuator for something, as applications do."""


def replayed(
    wiring: Wiring, services: Sequence[ResolvedService], own: tuple[Path, ...]
) -> tuple[Wiring, Mapping[str, tuple[str, ...]]]:
    """The wiring with what recordings can send alone, and the messages that each service leaves out for that.

    ``own`` are the files with the deployment's messages.
    """
    players = [each for each in services if ANYTHING in each.messages.outputs and _recording(each)]
    if not players:
        return wiring, {}
    ids = frozenset(known_ids(own).items())
    applications = {str(port): port for port in _of_application(wiring)}
    unsent, left_out = set(), {}
    for player in players:
        for port in {end.port for end in wiring.consumed if end.port.kind == "message"}:
            if str(port) in applications or not may_send(player, port, ids):
                unsent.add((player.use.name, str(port)))
        if WITHOUT in player.arguments:
            held = (name for name, port in applications.items() if may_send(player, port, ids))
            left_out[player.use.name] = tuple(sorted(held))
    return replace(wiring, unsent=frozenset(unsent)), left_out


def _of_application(wiring: Wiring) -> Iterator[Port]:
    """Messages that are the application's in a test: those by which it is judged, and others that it declares."""
    truths = [end.port for end in wiring.consumed if end.port.truth]
    for end in wiring.consumed:
        port = end.port
        if end.layer != "evaluation" or port.truth or port.stamp is None or not port.can_be_required:
            continue
        is_target, is_request = str(port) in map(str, truths), port.name.endswith(_REQUEST)
        if is_target or is_request or any(port == each.port for each in wiring.application_produces):
            yield port
    for end in wiring.application_produces:
        if end.port.kind == "message" and not any(truth.consumes(end.port) for truth in truths):
            yield end.port


def may_send(service: ResolvedService, port: Port, ids: frozenset[tuple[str, int]]) -> bool:
    """Whether a service of which the manifest only shows that it may send anything can send what a port consumes.

    ``ids`` are names and numbers of messages. A recording that is too large or damaged may hold any.
    """
    path = _recording(service)
    if path is None:
        return True
    only, without = (_ports(service.texts.get(name, "")) for name in (ONLY, WITHOUT))
    if any(_is_all_of(other, port) for other in without) or (only and not any(port.consumes(each) for each in only)):
        return False
    numbers = {number for name, number in ids | _former_ids() if name == port.name}
    return any(holds(path, number, _NO_STAMP if port.stamp is None else port.stamp) for number in numbers)


@functools.cache
def _former_ids() -> frozenset[tuple[str, int]]:
    return frozenset((one.name, one.id) for one in odvd.load(STANDARD_0_9))


def without_pictures(service: ResolvedService) -> bool:
    path = _recording(service)
    return path is not None and not holds(path, known_ids(())[IMAGE], _NO_STAMP)


def _recording(service: ResolvedService) -> Path | None:
    found = [a.value.path for a in service.arguments.values() if a.parameter.format == FORMAT and a.value]
    return found[0] if len(found) == 1 else None


def _ports(text: str) -> list[Port]:
    return [message(word, None) for word in text.split(",") if word]


def _is_all_of(other: Port, port: Port) -> bool:
    """Whether ``other`` has every message that the port consumes."""
    return other.name == port.name and other.stamp in (None, port.stamp)


@functools.lru_cache(maxsize=256)
def holds(path: Path, number: int, stamp: int) -> bool:
    """Whether a recording may hold a message, of any sender for ``_NO_STAMP``."""
    try:
        found = recording_contents.contents(path)
    except OSError:
        return True  # reported with the file
    senders = found.senders(number)
    return bool(senders if stamp == _NO_STAMP else stamp in senders) or not found.is_whole


@functools.cache
def known_ids(own: tuple[Path, ...]) -> Mapping[str, int]:
    return {name: definition.id for name, definition in known_messages(own).items()}


@functools.cache
def known_messages(own: tuple[Path, ...]) -> Mapping[str, odvd.Definition]:
    """The standard messages and those in a deployment's files, as far as these can be read, by name."""
    found = {d.name: d for d in odvd.shipped()}
    for path in own:
        try:
            found.update((d.name, d) for d in odvd.load(path))
        except odvd.OdvdError:
            continue  # reported with the deployment
    return found


@dataclass(frozen=True)
class ResolvedTest:
    """One instance with its rig, the services whose manifests are known and in whose layer they may be, and its wiring
    with the application.

    ``left_out`` are messages that services which play recordings leave out, because they are the application's.
    """

    spec: Spec
    rig: Rig | None
    services: tuple[ResolvedService, ...]
    wiring: Wiring
    left_out: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def is_complete(self) -> bool:
        """Whether every service of the spec could be read, has a manifest, and is in a layer that this names."""
        return self.spec.is_whole and len(self.services) == len(self.spec.uses)

    @functools.cached_property
    def variables(self) -> dict[str, str]:
        return {name: e.value.text for name, e in self.spec.variables.items() if isinstance(e.value, Scalar)}


def isolation(spec: Spec, rig: Rig | None) -> str:
    """The isolation that the spec sets, else its rig's, else its own network."""
    return spec.isolation or (rig.isolation if rig else "network")


def resolve(
    specs: Iterable[Spec],
    manifests: Mapping[str, Manifest],
    deployment: Deployment,
    application: ApplicationSource | None,
) -> list[ResolvedTest]:
    declared = application.declared if application else None
    found: list[ResolvedTest] = []
    known: Known = {}
    for spec in specs:
        rig = deployment.rig(spec.rig) or (emulated(spec.rig) if spec.rig in KIND_TAGS else None) if spec.rig else None
        services = tuple(
            resolved(spec, use, manifest, rig, known)
            for use in spec.uses
            if (manifest := manifests.get(use.uses.text)) is not None and use.layer in manifest.layers
        )
        services = tuple(_at_camera_rate(each, services) for each in services)
        judged, is_judged = ",".join(_lines_of_judges(services)), operator.attrgetter("parameter.judged")
        services = tuple(_with_default(each, judged, is_judged) for each in services)
        types = own_types(deployment.ros_types)
        services, wiring = _driven(services, wire(services, declared, types), declared, types)
        if takes_old_frames(wiring, deployment.messages):
            services = tuple(_with_default(each, "true", lambda it: it.parameter.name == EULER) for each in services)
        if spec.timeout_s and (spec.until or any(service.ends_input for service in services)):
            ending = operator.attrgetter("parameter.within_timeout")
            longest = f"{spec.timeout_s:g}"
            services = tuple(s if s.use.name == spec.until else _with_default(s, longest, ending) for s in services)
        found.append(ResolvedTest(spec, rig, services, *replayed(wiring, services, deployment.messages)))
    return found


@functools.cache
def own_types(files: tuple[Path, ...]) -> Mapping[str, Collection[str]]:
    """The fields of the deployment's own ROS types, by name; none if they cannot be read."""
    if not files:
        return {}
    from dodo_dsl.opendlv.ros_codec import Codec, RosTypeError

    try:
        codec = Codec(files)
    except RosTypeError:
        return {}  # reported with the deployment
    return {name: codec.fields(name) for name in codec.own}


def _at_camera_rate(service: ResolvedService, others: Iterable[ResolvedService]) -> ResolvedService:
    """The same, where its rate is by default that of another service whose own is not written either."""
    if (rate := service.arguments.get("freq")) and not rate.value and not rate.entry:
        found = (each.arguments["freq"].value for each in others if each.use.uses.text == rate.parameter.shared)
        return replace(service, arguments={**service.arguments, "freq": replace(rate, value=next(found, None))})
    return service


def _lines_of_judges(services: Iterable[ResolvedService]) -> Iterable[str]:
    """Goals and gates of the evaluators, each once: lines of a map that a vehicle crosses."""
    texts = [service.texts for service in services if service.use.layer == "evaluation"]
    names = (name for each in texts for key in ("goal", "gates") for name in each.get(key, "").split(","))
    return dict.fromkeys(filter(None, names))


def _driven(
    services: tuple[ResolvedService, ...],
    wiring: Wiring,
    declared: Mapping[str, Declared | None] | None,
    types: Mapping[str, Collection[str]],
) -> tuple[tuple[ResolvedService, ...], Wiring]:
    messages = ",".join(driving(wiring))
    is_driving = operator.attrgetter("parameter.driving")
    found = tuple(_with_default(each, messages, is_driving) for each in services) if messages else services
    return (services, wiring) if all(map(operator.is_, found, services)) else (found, wire(found, declared, types))


def _with_default(service: ResolvedService, text: str, is_meant: Callable[[Argument], bool]) -> ResolvedService:
    changed = {
        name: replace(each, value=replace(each.value, text=text))
        for name, each in service.arguments.items()
        if is_meant(each) and each.entry is None and each.value and each.value.text != text
    }
    return replace(service, arguments={**service.arguments, **changed}) if changed else service


def takes_old_frames(wiring: Wiring, own: tuple[Path, ...]) -> bool:
    """Whether the application takes Frame, and means that of message set 0.9."""
    if not own or all(end.port.name != FRAME for end in wiring.application_consumes):
        return False
    return all(map(known_messages(own)[FRAME].fits, (d for d in odvd.load(STANDARD_0_9) if d.name == FRAME)))


@dataclass(frozen=True)
class RuleContext:
    """One instance with its deployment and application; ``by_name`` has one instance of each file by its name."""

    test: ResolvedTest
    manifests: Mapping[str, Manifest]
    by_name: Mapping[str, list[Spec]]
    deployment: Deployment
    application: ApplicationSource | None = None

    @property
    def spec(self) -> Spec:
        return self.test.spec

    @property
    def rig(self) -> Rig | None:
        return self.test.rig

    @property
    def services(self) -> tuple[ResolvedService, ...]:
        """Those that are known in their layers; ``unknown-service`` and ``wrong-layer`` report the others."""
        return self.test.services

    @property
    def wiring(self) -> Wiring:
        return self.test.wiring

    @property
    def messages(self) -> Collection[str]:
        """The full names of all messages: OpenDLV's, DoDo's and the deployment's, as far as these can be read."""
        return known_ids(self.deployment.messages)


Rule = Callable[[RuleContext], Iterator[Diagnostic]]
