"""CIDs are unique while the range lasts, and never shared by tests on the host network."""

import ipaddress
import itertools
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.plan.addresses import OutOfAddresses, Subnets, cids, prefix, subnets
from dodo_dsl.spec.deployment import Deployment

RANGE = Deployment.cids


NAMES = [f"sil-{number}" for number in range(400)]
SMALL = ipaddress.IPv4Network("10.213.0.0/24")


def on_own(names: Sequence[str]) -> dict[str, int]:
    return dict(zip(names, cids(names, ["network"] * len(names), RANGE), strict=True))


def test_a_test_has_the_same_cid_whatever_is_compiled_beside_it() -> None:
    alone = {name: on_own([name])[name] for name in NAMES}
    apart = list({cid: name for name, cid in alone.items()}.values())
    assert len(apart) > 100
    assert on_own(apart) == {name: alone[name] for name in apart}


def test_of_tests_with_the_same_number_the_first_keeps_it_and_others_get_the_next() -> None:
    number = on_own(NAMES[:1])[NAMES[0]]
    same = [name for name in NAMES if on_own([name])[name] == number][:2]
    assert on_own(same) == {same[0]: number, same[1]: number + 1}
    reversed_ = on_own(same[::-1])
    assert reversed_ == {same[1]: number, same[0]: number + 1}
    assert sorted(on_own(NAMES[:127]).values()) == list(range(128, 255)), "the range is used up to its end"


def test_tests_on_the_host_do_not_make_way_for_others() -> None:
    given_cids = cids(NAMES[:3], ["network", "network", "host"], RANGE)
    assert given_cids[2] == on_own([NAMES[2]])[NAMES[2]]


@given(st.lists(st.sampled_from(["network", "host"]), min_size=1, max_size=400))
def test_host_tests_never_share(isolations: list[str]) -> None:
    hosts = isolations.count("host")
    if len(isolations) > len(RANGE) and hosts >= len(RANGE):
        with pytest.raises(OutOfAddresses):
            cids(NAMES[: len(isolations)], isolations, RANGE)
        return
    given_cids = cids(NAMES[: len(isolations)], isolations, RANGE)
    assert set(given_cids) <= set(RANGE)
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
    assert set(map(str, found)) <= set(subnets(network, length))


def test_large_and_small_subnets_are_apart() -> None:
    give = Subnets(SMALL).give
    found = [
        ipaddress.IPv4Network(give(name, containers))
        for name, containers in zip(NAMES, (1, 29, 1, 61, 1), strict=False)
    ]
    assert sorted(part.prefixlen for part in found) == [26, 27, 28, 28, 28]
    assert not any(a.overlaps(b) for a, b in itertools.combinations(found, 2))


def test_a_subnet_that_is_too_small_for_the_application() -> None:
    with pytest.raises(OutOfAddresses, match="14 containers and so needs a /27"):
        Subnets(ipaddress.IPv4Network("10.213.0.0/28")).give("sil", 14)
