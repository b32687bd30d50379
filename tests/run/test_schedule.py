"""The order of tests, the cores that they need and share, and the forecast."""

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.plan.model import Flag, PlannedService
from dodo_dsl.run.backends import Job
from dodo_dsl.run.schedule import CorePool, Schedule, cores_needed, schedule
from tests.run.scripted import JumpingLoop, plan


def camera(**flags: str) -> PlannedService:
    return PlannedService("environment", "camera", "x", "x", ("x",), tuple(Flag(k, v) for k, v in flags.items()))


def test_larger_pictures_need_more_cores() -> None:
    empty = plan()
    small = replace(empty, services=(camera(width="320", height="240", freq="10"),))
    large = replace(empty, services=(camera(width="1280", height="720", freq="30"),))
    assert cores_needed(empty) < cores_needed(small) < 0.5 < 1 < cores_needed(large)
    assert cores_needed(replace(small, clock="lockstep")) == 1.0
    assert cores_needed(replace(small, clock="virtual")) == 1.0
    endless = replace(empty, services=(camera(width="nan", height="240", freq="inf"),))
    assert cores_needed(endless) == cores_needed(empty)
    assert cores_needed(replace(empty, rig="kiwi")) == 2.0


def test_what_earlier_runs_used_counts_more_than_pictures() -> None:
    large = replace(plan(), services=(camera(width="1280", height="720", freq="30"),))
    assert cores_needed(large, 0.4) == 0.6
    assert cores_needed(large, 0.0) == 0.1
    assert cores_needed(replace(large, clock="lockstep"), 0.4) == 1.0
    assert cores_needed(replace(large, rig="kiwi"), 0.4) == 2.0
    used = schedule(None, lambda _: 1.0, lambda j: 0.4 if j.test == "large" else None)
    assert used.need(Job(large, Path(), Path(), "large")) == 0.6
    assert used.need(Job(large, Path(), Path(), "small")) == cores_needed(large)


@given(
    jobs=st.lists(st.tuples(st.floats(0.1, 9), st.floats(0.1, 4)), min_size=1, max_size=12), capacity=st.floats(0.5, 4)
)
@pytest.mark.thorough
def test_the_forecast_lies_between_what_is_possible(jobs: list[tuple[float, float]], capacity: float) -> None:
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


@given(needs=st.lists(st.floats(0.1, 4), max_size=20), capacity=st.floats(0.5, 4))
@pytest.mark.thorough
def test_cores_are_never_given_twice(needs: list[float], capacity: float) -> None:
    taken = {"now": 0.0, "most": 0.0}

    async def one(pool: CorePool, need: float) -> None:
        async with pool.take(need):
            taken["now"] += min(need, capacity)
            taken["most"] = max(taken["most"], taken["now"])
            await asyncio.sleep(0)
            taken["now"] -= min(need, capacity)

    async def all_() -> None:
        pool = CorePool(capacity)
        await asyncio.gather(*(one(pool, need) for need in needs))

    asyncio.run(all_())
    assert taken["most"] <= capacity + 1e-6


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
    order = Schedule(1.0, lambda _: 1.0, lambda j: lengths[j.test])
    assert [j.test for j in order.ordered([job(name) for name in "abcd"])] == ["b", "d", "c", "a"]


def test_running_jobs_have_less_to_go() -> None:
    order = Schedule(2.0, lambda _: 1.0, lambda _: 10.0)
    assert order.forecast([], [(job("a"), 4.0), (job("b"), 12.0)]) == 6.0
    assert order.forecast([job("c")], [(job("a"), 4.0), (job("b"), 12.0)]) == 10.0
    assert order.forecast([]) == 0.0


def test_a_number_of_jobs_counts_instead_of_cores() -> None:
    assert (schedule(3, lambda _: 1.0).capacity, schedule(3, lambda _: 1.0).need(job("a"))) == (3, 1.0)
    assert schedule(None, lambda _: 1.0).capacity >= 1


def test_cores_that_set_up_needs_no_more_are_given_back() -> None:
    begins: list[tuple[str, float]] = []

    async def use(pool: CorePool, name: str) -> None:
        async with pool.take(1.0) as share:
            await asyncio.sleep(2)
            begins.append((name, asyncio.get_running_loop().time()))
            share.shrink(0.4)
            share.shrink(0.4)
            await asyncio.sleep(10)

    async def scene() -> float:
        pool = CorePool(2.0)
        await asyncio.gather(*(use(pool, name) for name in "abcd"))
        async with asyncio.timeout(0), pool.take(2.0):
            return asyncio.get_running_loop().time()

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        assert runner.run(scene()) == 24.0
    assert begins == [("a", 2.0), ("b", 2.0), ("c", 4.0), ("d", 14.0)], (
        "d waits, as its set-up would disturb the others"
    )


def test_first_come_first_served() -> None:
    """A test that needs two cores is not overtaken by those that need one."""
    order: list[str] = []

    async def use(pool: CorePool, name: str, need: float, seconds: float) -> None:
        async with pool.take(need):
            order.append(name)
            await asyncio.sleep(seconds)

    async def scene() -> float:
        pool = CorePool(2.0)
        await asyncio.gather(use(pool, "a", 1, 3), use(pool, "b", 5, 1), use(pool, "c", 1, 1), use(pool, "d", 1, 1))
        return asyncio.get_running_loop().time()

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        assert runner.run(scene()) == 5.0
    assert order == ["a", "b", "c", "d"]
