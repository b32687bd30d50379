"""CIDs in the order of names, and subnets by names, so that the same specs get the same numbers on any machine.

A test keeps its subnet whatever else is compiled; if another test has it, the next free one is taken.
"""

import ipaddress
import zlib
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


def _number(name: str, count: int) -> int:
    return zlib.crc32(name.encode()) % count


class Subnets:
    """Gives subnets of the deployment's network, apart from one another while there are free ones."""

    def __init__(self, network: ipaddress.IPv4Network) -> None:
        self._network = network
        self._taken: set[int] = set()
        """Subnets of the smallest size, by their order."""
        self._full: set[int] = set()
        """Lengths of which no subnet is free."""

    def give(self, name: str, containers: int = 1) -> str:
        """A test's subnet, with room for so many containers as far as the network has it."""
        network = self._network
        length = max(prefix(containers), network.prefixlen)
        index = self._free(_number(name, 1 << (length - network.prefixlen)), length)
        self._taken.update(_parts(index, length))
        return f"{ipaddress.IPv4Address(int(network.network_address) + (index << (32 - length)))}/{length}"

    def _free(self, first: int, length: int) -> int:
        """The first free subnet of a length from ``first`` on; ``first`` if none is free."""
        count = 1 << (length - self._network.prefixlen)
        for step in range(0 if length in self._full else count):
            index = (first + step) % count
            if self._taken.isdisjoint(_parts(index, length)):
                return index
        self._full.add(length)
        return first


def _parts(index: int, length: int) -> range:
    size = 1 << (SMALLEST - length)
    return range(index * size, (index + 1) * size)
