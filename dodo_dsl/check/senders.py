"""Who alone may send a message of a test, and what its application must not hear, derived from its wiring."""

from collections.abc import Iterable, Iterator

from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.check.wiring import ANYTHING, End, Port, Wiring
from dodo_dsl.opendlv.address import LINES, POSE, is_of_the_world

SENDING_LAYERS = ("environment", "action")
END_OF_INPUT = "dodo.EndOfInput"


def senders(test: ResolvedTest) -> tuple[str, ...]:
    """Words such as ``opendlv.sim.Frame/0=pose``: a message that services consume, and the services that may send it.

    ``my-pose?`` is a service of the deployment, which need not say from where it sends. Messages that the application
    declares are left out, unless it is judged by them.
    """
    wiring = test.wiring
    own = {service.use.name for service in test.services if not is_shipped(service.manifest.process)}
    table: dict[Port, list[str]] = {}
    for end in wiring.consumed:
        for port in _guarded(end.port, wiring):
            table.setdefault(port, sorted({each.service for each in wiring.producers(port)}))
    for end in wiring.printed:
        if not wiring.judges_by(end.port):
            table[end.port] = [LINES]
    uses = test.spec.uses
    sources = sorted(u.name for u in uses if u.layer in SENDING_LAYERS or u.name == test.spec.until)
    table[Port("message", END_OF_INPUT)] = sources
    words = (
        f"{port}={','.join(f'{name}?' if name in own else name for name in names)}" for port, names in table.items()
    )
    return tuple(sorted(words))


def truth(test: ResolvedTest) -> tuple[str, ...]:
    ports = (end.port for end in test.wiring.consumed if test.wiring.is_truth(end.port))
    return tuple(sorted({str(port) for port in ports}))


def _guarded(consumed: Port, wiring: Wiring) -> Iterable[Port]:
    """The messages among those that a port consumes which the application must not send."""
    if consumed.kind == "memory" or consumed.name == ANYTHING:
        return ()
    if wiring.is_truth(consumed):
        return (Port("message", consumed.name, consumed.stamp),)
    if any(consumed.consumes(end.port) for end in wiring.application_produces):
        return ()
    if not consumed.can_be_required:
        return (Port("message", consumed.name, consumed.stamp),)
    produced = (end.port for end in wiring.producers(consumed) if end.port.name != ANYTHING)
    return (Port("message", port.name, port.stamp) for port in produced)


def is_shipped(process: tuple[str, ...]) -> bool:
    """Whether a service is one of DoDo's programs, which say from where they send."""
    return process[:2] == ("python", "-m") and process[2:3] != () and process[2].startswith("services.")


HIDDEN = "hidden"
"""Value of ``pose``: the application must not declare to take what only a simulation knows."""


def told(wiring: Wiring) -> tuple[End, ...]:
    """What the application declares to take of what only a simulation knows, and so gets."""
    ends = (end for end in wiring.application_consumes if is_of_the_world(end.port.name))
    return tuple(
        end
        for end in ends
        if not any(wiring.is_truth(other.port) for other in wiring.consumed if other.port.consumes(end.port))
    )


def told_in_words(names: tuple[str, ...]) -> str:
    """What an application hears that no car does on a road, by ``names`` of ``told``; empty for none."""
    if not names:
        return ""
    listed = ", ".join(names)
    is_pose = any(name.partition("/")[0] in POSE for name in names)
    return f"the application gets its true pose ({listed})" if is_pose else f"the application gets {listed}"


def services(test: ResolvedTest, automatic: tuple[str, ...]) -> tuple[str, ...]:
    """The test's services by name, and ``automatic`` ones.

    ``judge?=opendlv.sim.Frame/0`` is one of the deployment, which need not say where it listens, with what it consumes.
    """
    own = (_word(test, service.use.name, is_shipped(service.manifest.process)) for service in test.services)
    return tuple(sorted((*automatic, *own)))


def _word(test: ResolvedTest, name: str, shipped: bool) -> str:
    return name if shipped else f"{name}?={','.join(sorted(set(_consumed(test.wiring, name))))}"


def _consumed(wiring: Wiring, service: str) -> Iterator[str]:
    for end in wiring.consumed:
        if end.service == service and end.port.name != ANYTHING and is_of_the_world(end.port.name):
            yield str(end.port)
