"""What snapshots add up to: who waited and whose fault it was, and what was used."""

import asyncio
from collections.abc import Callable, Iterable

import pytest

from dodo_dsl.outcome import MachineLoad, ServiceUse, Wait
from dodo_dsl.run.machine_load.meter import (
    LAST_PATIENCE_S,
    PERIOD_S,
    Meter,
)
from dodo_dsl.run.machine_load.service_use import Snapshot, Used
from tests.run.scripted import load, run

MB = 1e6
TIMES = [0.1 * n for n in range(60)]


async def nothing() -> None:
    return None


def added(
    snapshots: Iterable[Snapshot],
    is_application: Callable[[str], bool] = lambda name: name == "app",
    test_s: Callable[[], float] = float,
) -> Meter:
    meter = Meter(nothing, test_s, is_application)
    for snapshot in snapshots:
        meter.add(snapshot)
    return meter


def measured(others: float, app: tuple[float, float], camera: tuple[float, float] = (0.2, 0.0)) -> MachineLoad:
    """Two cores for 10 s."""
    at = load(others, app=app, camera=camera)
    found = added(at(100.0 + 0.1 * number) for number in range(101)).load()
    assert found is not None
    return found


def test_the_load_of_a_busy_machine() -> None:
    found = measured(0.8, app=(0.2, 0.3), camera=(0.2, 0.05))
    assert (found.duration_s, found.cores) == (pytest.approx(10.0), 2)
    assert (found.others_share, found.crowded_s) == (pytest.approx(0.8), pytest.approx(10.0))
    assert found.application == Wait(pytest.approx(2.0), pytest.approx(3.0), pytest.approx(3.0), "app")
    assert found.services == Wait(pytest.approx(2.0), pytest.approx(0.5), pytest.approx(0.5), "camera")
    over = measured(0.8, app=(0.2, 1.4)).application
    assert over == Wait(pytest.approx(2.0), pytest.approx(10.0), pytest.approx(10.0), "app"), "no longer than the test"


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


def test_snapshots_are_taken_from_begin_to_end() -> None:
    async def scene() -> list[float]:
        times: list[float] = []

        async def take() -> None:
            times.append(asyncio.get_running_loop().time())

        meter = Meter(take, float, bool)
        meter.begin()
        await asyncio.sleep(2.5 * PERIOD_S)
        await meter.end()
        await asyncio.sleep(9 * PERIOD_S)
        return [time_s / PERIOD_S for time_s in times]

    assert run(scene()) == pytest.approx([0.0, 1.0, 2.0, 2.5])


def test_a_backend_that_does_not_answer_holds_up_nothing_for_long() -> None:
    async def scene() -> float:
        meter = Meter(lambda: asyncio.sleep(600, None), float, bool)
        meter.begin()
        await asyncio.sleep(1.0)
        await meter.end()
        return asyncio.get_running_loop().time()

    assert run(scene()) == pytest.approx(1.0 + LAST_PATIENCE_S)


def test_figures_are_by_the_test_s_own_time() -> None:
    """Ten times as fast as the wall: half of a processor by its time is a twentieth by the test's."""
    sizes = [900 * MB if n == 777 else 100 * MB + 10 * MB * 0.002 * n for n in range(5000)]
    taken = [Snapshot(50.0 + 0.002 * n, {"a": Used(3.0 + 0.001 * n, 0.0, int(size))}) for n, size in enumerate(sizes)]
    snapshots = [*taken, Snapshot(60.0, {"a": Used(8.0, 0.0, 0)})]
    times = iter(10 * (snapshot.at_s - 50.0) for snapshot in snapshots)
    (use,) = added(snapshots, test_s=lambda: next(times)).figures(["a", "b"])
    expected = ServiceUse("a", 5.0, pytest.approx(0.05), 900_000_000)
    assert (use, added([]).figures(["a"])) == (expected, ())
