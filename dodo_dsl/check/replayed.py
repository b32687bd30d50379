"""Whether a service that plays a recording can send a message: by its parameters, and by what the recording holds."""

import functools
from pathlib import Path

from dodo_dsl.check.wiring import Port, message
from dodo_dsl.opendlv.inputs import recording_contents
from dodo_dsl.opendlv.odvd import STANDARD_0_9, parser
from dodo_dsl.spec.arguments import ResolvedService

FORMAT = "recording"
ONLY, WITHOUT = "messages", "without"
"""Parameters of messages that are played alone, and that are left out."""
_NO_STAMP = -1


def may_send(service: ResolvedService, port: Port, ids: frozenset[tuple[str, int]]) -> bool:
    """Whether a service of which the manifest only says that it may send anything can send what a port consumes.

    ``ids`` are names and numbers of messages. A recording that is too large or damaged may hold any.
    """
    recordings = [a.value.path for a in service.arguments.values() if a.parameter.format == FORMAT and a.value]
    path = recordings[0] if len(recordings) == 1 else None
    if path is None:
        return True
    only, without = (_ports(service.texts.get(name, "")) for name in (ONLY, WITHOUT))
    if any(_is_all_of(other, port) for other in without) or (only and not any(port.consumes(each) for each in only)):
        return False
    old = frozenset((one.name, one.id) for one in parser.load(STANDARD_0_9))
    numbers = {number for name, number in ids | old if name == port.name}
    return any(_holds(path, number, _NO_STAMP if port.stamp is None else port.stamp) for number in numbers)


def _ports(text: str) -> list[Port]:
    return [message(word, None) for word in text.split(",") if word]


def _is_all_of(other: Port, port: Port) -> bool:
    """Whether ``other`` has every message that the port consumes."""
    return other.name == port.name and other.stamp in (None, port.stamp)


@functools.lru_cache(maxsize=256)
def _holds(path: Path, number: int, stamp: int) -> bool:
    try:
        found = recording_contents.look(path, number, stamp)
    except OSError:
        return True  # told with the file
    return bool(found.senders if stamp == _NO_STAMP else stamp in found.senders) or not found.is_whole
