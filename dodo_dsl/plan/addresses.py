"""CIDs and subnets, given in name order so that the same specs get the same numbers on any machine."""

import ipaddress
from collections.abc import Sequence


class OutOfAddresses(ValueError):
    """More tests than the deployment's range can hold."""


def cids(isolations: Sequence[str], available: Sequence[int]) -> list[int]:
    """A CID for each test: unique while the range lasts, beyond it only tests on a network of their own share one.

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


def subnets(network: ipaddress.IPv4Network) -> list[str]:
    """Every /28 of the deployment's network, in order."""
    return [subnet(index, network) for index in range(1 << (28 - network.prefixlen))]


def subnet(index: int, network: ipaddress.IPv4Network) -> str:
    """The ``index``-th /28 of the deployment's network; the range starts again when it is used up."""
    count = 1 << (28 - network.prefixlen)
    base = int(network.network_address) + 16 * (index % count)
    return f"{ipaddress.IPv4Address(base)}/28"
