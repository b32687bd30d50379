"""The order of tests, the cores that they need and share, and the forecast."""

import os
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.run.backends import Job
from dodo_dsl.run.schedule import Schedule, schedule
from tests.run.scripted import plan


@given(
    jobs=st.lists(st.tuples(st.floats(0.1, 9), st.integers(1, 4)), min_size=1, max_size=12), capacity=st.integers(1, 4)
)
@pytest.mark.thorough
def test_the_forecast_lies_between_what_is_possible(jobs: list[tuple[float, int]], capacity: int) -> None:
    """No shorter than the longest test or than all cores busy all the time, no longer than one by one."""
    named = {f"{n}": job for n, job in enumerate(jobs)}
    given_ = [job(name) for name in named]
    order = Schedule(capacity, lambda j: named[j.test][1], lambda j: named[j.test][0])
    seconds = order.forecast(order.ordered(given_))
    busy = sum(length * min(need, capacity) for length, need in jobs) / capacity
    assert max(*(length for length, _ in jobs), busy) - 1e-6 <= seconds <= sum(length for length, _ in jobs) + 1e-6


def job(name: str) -> Job:
    found = object.__new__(Job)
    object.__setattr__(found, "test", name)
    return found


def test_the_longest_come_first_and_equal_ones_keep_their_order() -> None:
    lengths = {"a": 1.0, "b": 3.0, "c": 2.0, "d": 3.0}
    order = Schedule(1, lambda _: 1, lambda j: lengths[j.test])
    assert [j.test for j in order.ordered([job(name) for name in "abcd"])] == ["b", "d", "c", "a"]


def test_running_jobs_have_less_to_go() -> None:
    order = Schedule(2, lambda _: 1, lambda _: 10.0)
    assert order.forecast([], [(job("a"), 4.0), (job("b"), 12.0)]) == 6.0
    assert order.forecast([job("c")], [(job("a"), 4.0), (job("b"), 12.0)]) == 10.0
    assert order.forecast([]) == 0.0


def test_a_number_of_jobs_counts_instead_of_cores() -> None:
    assert (schedule(3, lambda _: 1.0).capacity, schedule(3, lambda _: 1.0).need(job("a"))) == (3, 1)
    cores = schedule(None, lambda _: 1.0)
    assert cores.capacity == len(os.sched_getaffinity(0))
    assert [cores.need(Job(replace(plan(), rig=rig), Path(), Path())) for rig in ("", "kiwi")] == [1, 2]
