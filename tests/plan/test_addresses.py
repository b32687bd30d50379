"""CIDs are unique while the range lasts, and never shared by tests on the host network."""

import ipaddress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.plan.addresses import OutOfAddresses, cids, prefix, subnet, subnets
from dodo_dsl.spec.deployment import Deployment

RANGE = Deployment.cids


def test_in_order_and_without_the_habitual_ones() -> None:
    assert cids(["network"] * 3, RANGE) == [128, 129, 130]
    assert cids(["network"] * 127, RANGE) == list(range(128, 255))


@given(st.lists(st.sampled_from(["network", "host"]), min_size=1, max_size=400))
def test_host_tests_never_share(isolations: list[str]) -> None:
    hosts = isolations.count("host")
    if len(isolations) > len(RANGE) and hosts >= len(RANGE):
        with pytest.raises(OutOfAddresses):
            cids(isolations, RANGE)
        return
    given_cids = cids(isolations, RANGE)
    assert set(given_cids) <= set(RANGE)
    if len(isolations) <= len(RANGE):
        assert len(set(given_cids)) == len(isolations)
    for cid, isolation in zip(given_cids, isolations, strict=True):
        if isolation == "host":
            assert given_cids.count(cid) == 1


def test_subnets_are_apart_and_begin_anew() -> None:
    network = ipaddress.IPv4Network("10.213.0.0/24")
    subnets = [ipaddress.IPv4Network(subnet(n, network)) for n in range(16)]
    assert len(set(subnets)) == 16
    assert all(s.subnet_of(network) for s in subnets)
    assert subnet(16, network) == str(subnets[0])


@pytest.mark.parametrize(("containers", "length"), [(1, 28), (13, 28), (14, 27), (29, 27), (30, 26), (300, 23)])
def test_subnets_grow_with_the_application(containers: int, length: int) -> None:
    network = ipaddress.IPv4Network("10.213.0.0/16")
    assert prefix(containers) == length
    found = [ipaddress.IPv4Network(subnet(n, network, containers)) for n in range(20)]
    assert {part.prefixlen for part in found} == {length}
    assert len(set(found)) == 20 and all(part.subnet_of(network) for part in found)
    assert subnets(network, length)[:20] == list(map(str, found))


def test_a_subnet_that_is_too_small_for_the_application() -> None:
    with pytest.raises(OutOfAddresses, match="14 containers and so needs a /27"):
        subnet(0, ipaddress.IPv4Network("10.213.0.0/28"), 14)
