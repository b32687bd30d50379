"""Which tests share a job."""

from collections import Counter

import pytest
from dodo_dsl.emit.pipeline_jobs import PipelineJob, packed
from hypothesis import given
from hypothesis import strategies as st

PLACES = [("sil", False, ""), ("dil", False, ""), ("hil", True, ""), ("hil", True, "one"), ("hil", True, "two")]
TESTS = st.lists(st.tuples(st.sampled_from(PLACES), st.floats(0, 600)), min_size=1, max_size=40)


def job(name: str, level: str = "sil", gated: bool = False, rig: str = "", minutes: int = 11) -> PipelineJob:
    return PipelineJob(name, level, gated, rig, minutes, (name,), (f"out/{name}",))


@given(tests=TESTS, most=st.integers(1, 12))
@pytest.mark.thorough
def test_every_test_is_in_one_job_of_its_kind_and_none_has_much_more_to_do(
    tests: list[tuple[tuple[str, bool, str], float]], most: int
) -> None:
    jobs = [job(f"t{number}", *place) for number, (place, _) in enumerate(tests)]
    seconds = {f"t{number}": took for number, (_, took) in enumerate(tests)}
    made = packed(jobs, most, seconds)
    assert Counter(test for one in made for test in one.tests) == Counter(list(seconds))
    assert len({one.name for one in made}) == len(made)
    kinds = {one.name: (one.gated, one.rig) for one in jobs}
    for kind in set(kinds.values()):
        mine = [one for one in made if {kinds[test] for test in one.tests} == {kind}]
        loads = [sum(seconds[test] for test in one.tests) for one in mine]
        number = list(kinds.values()).count(kind)
        assert len(mine) == min(number, 1 if kind[1] else most)
        longest = max(seconds[name] for name in kinds if kinds[name] == kind)
        assert max(loads) <= sum(loads) / len(mine) + longest * (1 - 1 / len(mine)) + 1e-6, "Graham's bound"
    assert sum(len(one.tests) for one in made) == sum(
        kinds[test] == (one.gated, one.rig) for one in made for test in one.tests
    )


def test_long_tests_have_jobs_of_their_own_and_short_ones_share() -> None:
    seconds = {"long": 100.0, "a": 30.0, "b": 20.0, "c": 10.0}
    made = packed([job(name) for name in seconds], 2, seconds)
    assert [(one.name, one.tests, one.minutes) for one in made] == [
        ("long", ("long",), 11),
        ("tests 2/2", ("a", "b", "c"), 13),
    ]
    assert made[1].script.startswith("dodo run --compiled out/a --compiled out/b --compiled out/c --report ")


def test_equal_tests_are_shared_the_same_way_each_time() -> None:
    names = [f"t{number}" for number in range(6)]
    made = packed([job(name) for name in names], 2, dict.fromkeys(names, 5.0))
    assert [one.tests for one in made] == [("t0", "t2", "t4"), ("t1", "t3", "t5")]
