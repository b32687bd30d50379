"""CIDs and subnets, given in name order so that the same specs get the same numbers on any machine."""

import ipaddress
from collections.abc import Sequence


class OutOfAddresses(ValueError):
    """More tests than the deployment's range can hold."""


def cids(isolations: Sequence[str], available: Sequence[int]) -> list[int]:
    """A CID for each test: unique while the range lasts, beyond it only tests on their own network share one.

    Tests on the host network come first. Raises OutOfAddresses when they alone are more than the range.
    """
    on_host = [i for i, isolation in enumerate(isolations) if isolation == "host"]
    if len(isolations) <= len(available):
        return list(available[: len(isolations)])
    if len(on_host) >= len(available):
        raise OutOfAddresses(f"{len(on_host)} tests on the host network, but only {len(available)} CIDs")
    given = dict(zip(on_host, available, strict=False))
    shared = list(available[len(on_host) :])
    rest = (i for i in range(len(isolations)) if i not in given)
    given.update((index, shared[n % len(shared)]) for n, index in enumerate(rest))
    return [given[i] for i in range(len(isolations))]


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


def subnet(index: int, network: ipaddress.IPv4Network, containers: int = 1) -> str:
    """The ``index``-th subnet of the deployment's network with room for so many containers.

    The range starts again when it is used up. Raises OutOfAddresses where it is smaller than one.
    """
    length = prefix(containers)
    if length < network.prefixlen:
        raise OutOfAddresses(f"a test has {containers} containers and so needs a /{length}, but 'subnets' is {network}")
    count = 1 << (length - network.prefixlen)
    base = int(network.network_address) + (1 << (32 - length)) * (index % count)
    return f"{ipaddress.IPv4Address(base)}/{length}"
