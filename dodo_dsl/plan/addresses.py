"""CIDs and subnets by the names of tests, so that a test has the same ones whatever is compiled beside it.

Each name gives a number. Where another test has it, the next free one is taken, in the order in which tests come, which
is that of their names: so the same specs get the same numbers on any machine.
"""

import ipaddress
import zlib
from collections.abc import Sequence


class OutOfAddresses(ValueError):
    """More tests than the deployment's range can hold."""


def _number(name: str, count: int) -> int:
    return zlib.crc32(name.encode()) % count


def cids(names: Sequence[str], isolations: Sequence[str], available: Sequence[int]) -> list[int]:
    """A CID for each test: unique while the range lasts, beyond it only tests on their own network share one.

    Tests on the host network come first. Raises OutOfAddresses when they alone are more than the range.
    """
    on_host = [i for i, isolation in enumerate(isolations) if isolation == "host"]
    if len(names) > len(available) and len(on_host) >= len(available):
        raise OutOfAddresses(f"{len(on_host)} tests on the host network, but only {len(available)} CIDs")
    others = [i for i, isolation in enumerate(isolations) if isolation != "host"]
    given: dict[int, int] = {}
    free = set(available)
    for index in [*on_host, *others][: len(available)]:
        first = _number(names[index], len(available))
        given[index] = next(cid for cid in (*available[first:], *available[:first]) if cid in free)
        free.remove(given[index])
    shared = [cid for cid in available if cid not in {given[index] for index in on_host}]
    return [given[i] if i in given else shared[_number(name, len(shared))] for i, name in enumerate(names)]


SMALLEST = 28
"""The prefix of the smallest subnet of a test, with room for 13 containers."""
_TAKEN = 3
"""Addresses of a subnet that no container gets: the network's, the engine's own, and that of broadcasts."""


def prefix(containers: int) -> int:
    """The length of the prefix of the smallest subnet in which each container has an address."""
    return min(SMALLEST, 32 - (containers + _TAKEN - 1).bit_length())


def subnets(network: ipaddress.IPv4Network, length: int = SMALLEST) -> list[str]:
    """Every subnet of a length in the deployment's network, in order."""
    return [str(part) for part in network.subnets(new_prefix=length)] if length >= network.prefixlen else []


class Subnets:
    """Gives subnets of the deployment's network, apart from one another while there are free ones."""

    def __init__(self, network: ipaddress.IPv4Network) -> None:
        self._network = network
        self._taken: set[int] = set()
        """Subnets of the smallest size, by their order."""
        self._full: set[int] = set()
        """Lengths of which no subnet is free."""

    def give(self, name: str, containers: int = 1) -> str:
        """A test's subnet, with room for so many containers.

        Raises OutOfAddresses where the network is smaller than one.
        """
        network, length = self._network, prefix(containers)
        if length < network.prefixlen:
            need = f"a test has {containers} containers and so needs a /{length}"
            raise OutOfAddresses(f"{need}, but 'subnets' is {network}")
        index = self._free(_number(name, 1 << (length - network.prefixlen)), length)
        self._taken.update(_parts(index, length))
        return f"{ipaddress.IPv4Address(int(network.network_address) + (index << (32 - length)))}/{length}"

    def _free(self, first: int, length: int) -> int:
        """The first free subnet of a length from ``first`` on; ``first`` where none is free."""
        count = 1 << (length - self._network.prefixlen)
        for step in range(0 if length in self._full else count):
            index = (first + step) % count
            if self._taken.isdisjoint(_parts(index, length)):
                return index
        self._full.add(length)
        return first


def _parts(index: int, length: int) -> range:
    """The subnets of the smallest size in the ``index``-th one of a length."""
    size = 1 << (SMALLEST - length)
    return range(index * size, (index + 1) * size)
