"""CIDs are unique while the range lasts, and never shared by tests on the host network."""

import ipaddress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.plan.addresses import OutOfAddresses, cids, subnet
from dodo_dsl.spec.deployment.deployment import Deployment

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
