"""CIDs and subnets in the order of names, so that the same specs get the same numbers on any machine."""

import ipaddress
from collections.abc import Sequence

from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.check.resolve import ResolvedTest, isolation
from dodo_dsl.check.spec_rules import SMALLEST, prefix, reserved_cid
from dodo_dsl.spec.deployment import Deployment


def of_tests(tests: Sequence[ResolvedTest], deployment: Deployment, application: ApplicationSource | None) -> list[int]:
    """A CID for each instance: its rig's, the one that is built into the application, or one of the range.

    Tests may have the same one that is built in: those on their own networks do not hear each other, and those on
    the host's wait for each other's leases.
    """
    reserved = [reserved_cid(test, application) for test in tests]
    free = [isolation(test.spec, test.rig) for test, cid in zip(tests, reserved, strict=True) if cid is None]
    given = iter(cids(free, deployment.cids))
    return [next(given) if cid is None else cid for cid in reserved]


def cids(isolations: Sequence[str], available: Sequence[int]) -> list[int]:
    """A CID for each test: unique while the range lasts, beyond it only tests on their own network share one.

    Tests on the host network come first; they share, too, when they alone are more than the range.
    """
    if len(isolations) <= len(available):
        return list(available[: len(isolations)])
    on_host = [i for i, isolation in enumerate(isolations) if isolation == "host"]
    given = dict(zip(on_host, available, strict=False))
    shared = available[len(on_host) :] or available
    rest = (i for i in range(len(isolations)) if i not in given)
    given.update((index, shared[n % len(shared)]) for n, index in enumerate(rest))
    return [given[i] for i in range(len(isolations))]


def subnets(network: ipaddress.IPv4Network, length: int = SMALLEST) -> list[str]:
    """Every subnet of a length in the deployment's network, in order."""
    return [str(part) for part in network.subnets(new_prefix=length)] if length >= network.prefixlen else []


class Subnets:
    """Gives subnets of the deployment's network one after the other, and from the first again when it is full."""

    def __init__(self, network: ipaddress.IPv4Network) -> None:
        self._network = network
        self._next = 0

    def give(self, containers: int) -> str:
        """A subnet with room for so many containers as far as the network has it."""
        length = max(prefix(containers), self._network.prefixlen)
        size = 1 << (32 - length)
        begin = -(-self._next // size) * size
        begin = begin if begin < self._network.num_addresses else 0
        self._next = begin + size
        return f"{self._network[begin]}/{length}"
