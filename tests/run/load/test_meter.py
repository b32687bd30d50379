"""What snapshots add up to: who waited, and whose fault it was."""

import asyncio
import contextlib
from dataclasses import replace

import pytest

from dodo_dsl.outcome import MachineLoad, Wait
from dodo_dsl.run.machine_load.meter import LAST_PATIENCE_S, PERIOD_S, LoadMeter, add_up
from dodo_dsl.run.machine_load.snapshot import Snapshot, Times, with_ended
from tests.run.scripted import load, run


def measured(others: float, app: tuple[float, float], camera: tuple[float, float] = (0.2, 0.0)) -> MachineLoad:
    """Two cores for 10 s."""
    at = load(others, app=app, camera=camera)
    found = add_up([at(100.0 + number) for number in range(11)], lambda name: name == "app")
    assert found is not None
    return found


def test_the_load_of_a_busy_machine() -> None:
    found = measured(0.8, app=(0.2, 0.3), camera=(0.2, 0.05))
    assert (found.duration_s, found.cores) == (10.0, 2)
    assert found.others_share == pytest.approx(0.8)
    assert found.crowded_s == 10.0
    assert found.application == Wait(pytest.approx(2.0), pytest.approx(3.0), pytest.approx(3.0), "app")
    assert found.services == Wait(pytest.approx(2.0), pytest.approx(0.5), pytest.approx(0.5), "camera")


@pytest.mark.parametrize(
    ("others", "app"),
    [(0.0, (1.8, 0.7)), (0.2, (1.2, 0.4)), (0.5, (0.2, 0.9))],
    ids=["its own threads", "mostly its own threads", "throttled on a machine with free cores"],
)
def test_a_wait_that_nobody_else_caused(others: float, app: tuple[float, float]) -> None:
    found = measured(others, app)
    assert found.application is not None
    assert found.application.waited_s == pytest.approx(10 * app[1])
    assert (found.application.displaced_s, found.crowded_s) == (0.0, 0.0)


def test_processes_that_came_and_went_may_have_been_the_others() -> None:
    """Where nobody counts what they took, nothing is put down to others."""
    at = load(0.8, app=(0.2, 0.3), camera=(0.2, 0.05))
    found = add_up([replace(at(100.0 + n), changes=min(n, 4)) for n in range(11)], lambda name: name == "app")
    assert found is not None and found.application is not None
    assert (found.crowded_s, found.application.displaced_s) == (6.0, pytest.approx(1.8))


def test_what_ended_is_the_applications() -> None:
    taken = load(0.8, app=(0.2, 0.3), camera=(0.2, 0.05))(10.0)
    found = with_ended(taken, {"app": 9.0}, 3)
    assert (found.services["app"].ran_s, found.services["camera"], found.changes) == (9.0, taken.services["camera"], 0)
    assert with_ended(taken, {"app": None}, 3) == replace(taken, changes=3)


def after(first: Snapshot, more: Snapshot) -> Snapshot:
    """What both have used together."""
    services = {name: Times(*map(sum, zip(first.services[name], more.services[name], strict=True))) for name in "ab"}
    return Snapshot(first.at_s + more.at_s, 2, first.busy_s + more.busy_s, services)


def test_the_service_that_others_kept_waiting_the_longest_is_named() -> None:
    """One waits more, but in the second half others have left."""
    busy, free = load(0.8, a=(0.1, 0.2), b=(0.1, 0.1)), load(0.0, a=(0.1, 0.2), b=(0.1, 0.9))
    later = [after(busy(5.0), free(float(n))) for n in range(1, 6)]
    found = add_up([*(busy(float(n)) for n in range(6)), *later], lambda _: True)
    assert found is not None
    assert found.application is not None
    assert (found.application.longest, found.crowded_s) == ("a", 5.0)
    assert found.application.displaced_s == pytest.approx(1.0)
    assert found.services == Wait(0.0, 0.0, 0.0, "")


def test_no_wait_is_longer_than_the_test() -> None:
    found = measured(0.8, app=(0.2, 1.4))
    assert found.application == Wait(pytest.approx(2.0), 10.0, 10.0, "app")


def test_two_snapshots_at_least() -> None:
    at = load(0.5)
    assert add_up([], bool) is None
    assert add_up([at(1.0)], bool) is None
    assert add_up([at(1.0), at(1.0)], bool) is None


def test_snapshots_are_taken_from_begin_to_end() -> None:
    async def scene() -> list[float]:
        async def take() -> Snapshot:
            return load(0.5)(asyncio.get_running_loop().time())

        meter = LoadMeter(take)
        meter.begin()
        await asyncio.sleep(2.5 * PERIOD_S)
        await meter.end()
        await asyncio.sleep(9 * PERIOD_S)
        return [snapshot.at_s / PERIOD_S for snapshot in meter.snapshots]

    assert run(scene()) == pytest.approx([0.0, 1.0, 2.0, 2.5])


def test_a_backend_that_does_not_answer_holds_up_nothing_for_long() -> None:
    async def scene() -> float:
        meter = LoadMeter(lambda: asyncio.sleep(600, None))
        meter.begin()
        await asyncio.sleep(1.0)
        await meter.end()
        return asyncio.get_running_loop().time()

    assert run(scene()) == pytest.approx(1.0 + LAST_PATIENCE_S)


def test_a_snapshot_that_comes_as_it_is_cancelled_ends_it_all_the_same() -> None:
    """As with ``asyncio.wait_for`` of Python 3.11, which then gives the result and forgets the cancellation."""

    async def take() -> Snapshot | None:
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.sleep(600)
        return None

    async def scene() -> None:
        meter = LoadMeter(take)
        meter.begin()
        await asyncio.sleep(0)
        await meter.end()

    run(asyncio.wait_for(scene(), 100 * LAST_PATIENCE_S))
