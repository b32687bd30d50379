"""What of a test's messages its application must not hear, derived from its wiring."""

from collections.abc import Iterator

from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.check.senders import is_shipped
from dodo_dsl.check.wiring import ANYTHING, End, Wiring
from dodo_dsl.opendlv.bus.address import POSE, is_of_the_world

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
    """What an application is told that none is told on a road; ``names`` as in ``told``, empty for nothing."""
    if not names:
        return ""
    listed = ", ".join(names)
    is_pose = any(name.partition("/")[0] in POSE for name in names)
    return f"the application is told its true pose ({listed})" if is_pose else f"the application is told {listed}"


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
