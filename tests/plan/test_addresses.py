"""CIDs are unique while the range lasts, and never shared by tests on the host network."""

import ipaddress
import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.check.spec_rules import prefix
from dodo_dsl.plan.addresses import Subnets, cids
from dodo_dsl.spec.deployment import Deployment

RANGE = Deployment.cids


NAMES = [f"sil-{number}" for number in range(400)]
SMALL = ipaddress.IPv4Network("10.213.0.0/24")


def test_in_order_and_without_the_habitual_ones() -> None:
    assert cids(["network"] * 3, RANGE) == [128, 129, 130]
    assert cids(["network"] * 127, RANGE) == list(range(128, 255))
    assert cids(["host", *["network"] * 3], [128, 129, 130]) == [128, 129, 130, 129]


@given(st.lists(st.sampled_from(["network", "host"]), min_size=1, max_size=400))
def test_host_tests_never_share(isolations: list[str]) -> None:
    hosts = isolations.count("host")
    given_cids = cids(isolations, RANGE)
    assert set(given_cids) <= set(RANGE)
    if len(isolations) > len(RANGE) and hosts >= len(RANGE):
        return  # reported as out-of-cids
    if len(isolations) <= len(RANGE):
        assert len(set(given_cids)) == len(isolations)
    for cid, isolation in zip(given_cids, isolations, strict=True):
        if isolation == "host":
            assert given_cids.count(cid) == 1


def test_subnets_are_apart_and_begin_anew() -> None:
    give = Subnets(SMALL).give
    subnets = [ipaddress.IPv4Network(give(name)) for name in NAMES[:16]]
    assert len(set(subnets)) == 16
    assert all(s.subnet_of(SMALL) for s in subnets)
    assert give(NAMES[16]) == Subnets(SMALL).give(NAMES[16]), "none is free: it has the one of its name"


def test_a_test_has_the_same_subnet_whatever_is_compiled_beside_it() -> None:
    give = Subnets(Deployment.subnets).give
    few = [give(name) for name in NAMES[:50]]
    assert few == [Subnets(Deployment.subnets).give(name) for name in NAMES[:50]]


@pytest.mark.parametrize(("containers", "length"), [(1, 28), (13, 28), (14, 27), (29, 27), (30, 26), (300, 23)])
def test_subnets_grow_with_the_application(containers: int, length: int) -> None:
    network = ipaddress.IPv4Network("10.213.0.0/16")
    assert prefix(containers) == length
    give = Subnets(network).give
    found = [ipaddress.IPv4Network(give(name, containers)) for name in NAMES[:20]]
    assert {part.prefixlen for part in found} == {length}
    assert len(set(found)) == 20 and all(part.subnet_of(network) for part in found)
    assert set(found) <= set(network.subnets(new_prefix=length))


def test_large_and_small_subnets_are_apart() -> None:
    give = Subnets(SMALL).give
    found = [
        ipaddress.IPv4Network(give(name, containers))
        for name, containers in zip(NAMES, (1, 29, 1, 61, 1), strict=False)
    ]
    assert sorted(part.prefixlen for part in found) == [26, 27, 28, 28, 28]
    assert not any(a.overlaps(b) for a, b in itertools.combinations(found, 2))
