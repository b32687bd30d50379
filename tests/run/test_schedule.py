"""The order of tests, the cores that they need and share, and the forecast."""

import asyncio
import os
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.run.backends import Job
from dodo_dsl.run.schedule import CorePool, Schedule, schedule
from tests.run.scripted import JumpingLoop, plan


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


@given(needs=st.lists(st.integers(1, 5), max_size=20), capacity=st.integers(1, 4))
@pytest.mark.thorough
def test_cores_are_never_given_twice(needs: list[int], capacity: int) -> None:
    taken = {"now": 0, "most": 0}

    async def one(pool: CorePool, need: int) -> None:
        async with pool.take(need):
            taken["now"] += min(need, capacity)
            taken["most"] = max(taken["most"], taken["now"])
            await asyncio.sleep(0)
            taken["now"] -= min(need, capacity)

    async def all_() -> None:
        pool = CorePool(capacity)
        await asyncio.gather(*(one(pool, need) for need in needs))

    asyncio.run(all_())
    assert taken["most"] <= capacity


def test_cores_are_free_again_after_an_interrupt() -> None:
    async def scene() -> bool:
        pool = CorePool(1)
        async with pool.take(1):
            waiting = asyncio.ensure_future(take(pool))
            await asyncio.sleep(0)
            waiting.cancel()
        async with asyncio.timeout(5), pool.take(1):
            return True

    async def take(pool: CorePool) -> None:
        async with pool.take(1):
            pass

    assert asyncio.run(scene())


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


def test_first_come_first_served() -> None:
    """A test that needs two cores is not overtaken by those that need one."""
    order: list[str] = []

    async def use(pool: CorePool, name: str, need: int, seconds: float) -> None:
        async with pool.take(need):
            order.append(name)
            await asyncio.sleep(seconds)

    async def scene() -> float:
        pool = CorePool(2)
        await asyncio.gather(use(pool, "a", 1, 3), use(pool, "b", 5, 1), use(pool, "c", 1, 1), use(pool, "d", 1, 1))
        return asyncio.get_running_loop().time()

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        assert runner.run(scene()) == 5.0
    assert order == ["a", "b", "c", "d"]
