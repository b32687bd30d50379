"""What services that play recordings send: by their parameters, by what the recordings hold, and by whose it is.

A recording of a drive holds what the application of that drive sent. What the application of a test sends itself, and
is judged by, is left out of what is played: it would be taken for the application's.
"""

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dodo_dsl.check.wiring import ANYTHING, Port, Wiring, message
from dodo_dsl.opendlv.inputs import recording_contents
from dodo_dsl.opendlv.odvd import STANDARD, STANDARD_0_9, parser
from dodo_dsl.spec.arguments import ResolvedService

FORMAT = "recording"
ONLY, WITHOUT = "messages", "without"
"""Parameters of messages that are played alone, and that are left out."""
IMAGE = "opendlv.proxy.ImageReading"
_NO_STAMP = -1
_REQUEST = "Request"
"""How messages are called that ask an actuator for something, as applications do."""


@dataclass(frozen=True)
class Replayed:
    """The wiring with what recordings can send alone, and the messages that each service leaves out for that."""

    wiring: Wiring
    left_out: Mapping[str, tuple[str, ...]]


def replayed(wiring: Wiring, services: Sequence[ResolvedService], own: tuple[Path, ...]) -> Replayed:
    """For the services of one test; ``own`` are the files with the deployment's messages."""
    players = [each for each in services if ANYTHING in each.manifest.messages.outputs and _recording(each)]
    if not players:
        return Replayed(wiring, {})
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
    return Replayed(replace(wiring, unsent=frozenset(unsent)), left_out)


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
    """Whether a service of which the manifest only says that it may send anything can send what a port consumes.

    ``ids`` are names and numbers of messages. A recording that is too large or damaged may hold any.
    """
    path = _recording(service)
    if path is None:
        return True
    only, without = (_ports(service.texts.get(name, "")) for name in (ONLY, WITHOUT))
    if any(_is_all_of(other, port) for other in without) or (only and not any(port.consumes(each) for each in only)):
        return False
    old = frozenset((one.name, one.id) for one in parser.load(STANDARD_0_9))
    numbers = {number for name, number in ids | old if name == port.name}
    return any(holds(path, number, _NO_STAMP if port.stamp is None else port.stamp) for number in numbers)


def without_pictures(service: ResolvedService) -> Path | None:
    """The recording that a service plays, if that has no pictures; None where it may have some."""
    path = _recording(service)
    image = known_ids(())[IMAGE]
    return None if path is None or holds(path, image, _NO_STAMP) else path


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
        found = recording_contents.look(path, number, stamp)
    except OSError:
        return True  # told with the file
    return bool(found.senders if stamp == _NO_STAMP else stamp in found.senders) or not found.is_whole


@functools.cache
def known_ids(own: tuple[Path, ...]) -> Mapping[str, int]:
    """The numbers of these messages, by name."""
    ids = {d.name: d.id for d in parser.load(STANDARD)}
    for path in own:
        try:
            ids.update((d.name, d.id) for d in parser.load(path))
        except parser.OdvdError:
            continue  # reported with the deployment
    return ids
