"""Order, places, forecast, history, and what is done about tests that do not pass."""

import asyncio
import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.plan.model import Flag, Service
from dodo_dsl.run.backends import Job
from dodo_dsl.run.history import History
from dodo_dsl.run.runner import Policy
from dodo_dsl.run.schedule import Places, Schedule, cores_needed
from tests.run.helpers import FAIL, READY, Bench

BROKEN = READY + "import sys; sys.exit(3)\n"


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_the_longest_begins_first(bench: Bench) -> None:
    bench.durations = {"a": 1.0, "b": 3.0, "c": 2.0}
    outcomes = bench.run(*(bench.plan(slug=slug) for slug in "abc"), parallel=1)
    assert [o.slug for o in outcomes] == ["a", "b", "c"]
    assert list(dict.fromkeys(slug for slug, _ in bench.progress.phases)) == ["b", "c", "a"]
    assert [tests for _, tests in bench.progress.rests] == [2, 1]


def test_fail_fast_begins_no_further_test(bench: Bench) -> None:
    bench.durations = {"a": 3.0, "b": 2.0}
    plans = [bench.plan(slug="a", judge=READY + FAIL), bench.plan(slug="b")]
    outcomes = bench.run(*plans, parallel=1, policy=Policy(fail_fast=True))
    assert [(o.slug, o.outcome) for o in outcomes] == [("a", "failed")]
    assert [job.test for job in bench.runner.skipped] == ["b"]


def test_an_error_is_tried_again_and_both_are_kept(bench: Bench) -> None:
    """A judge that breaks the first time; what the first attempt said lies beside the second's."""
    flag = bench.folder / "tried"
    once = f"import pathlib, sys\np = pathlib.Path({str(flag)!r})\nif not p.exists():\n    p.touch()\n    sys.exit(3)\n"
    plan = bench.plan(judge=READY + once + FAIL)
    (outcome,) = bench.run(plan, policy=Policy(retries=2))
    assert outcome.outcome == "failed"
    assert len(outcome.notes) == 1
    assert outcome.notes[0].startswith("attempt 1 ended in error: ")
    logs = bench.folder / "report" / "test" / "attempts" / "1" / "logs"
    assert (logs / "evaluation.judge.log").is_file()
    assert "verdict" in bench.log(plan, "evaluation.judge")


def test_errors_that_stay_are_errors(bench: Bench) -> None:
    (outcome,) = bench.run(bench.plan(judge=BROKEN), policy=Policy(retries=1))
    assert (outcome.outcome, len(outcome.notes)) == ("error", 1)


def camera(**flags: str) -> Service:
    return Service("environment", "camera", "x", "x", ("x",), tuple(Flag(k, v) for k, v in flags.items()))


def test_larger_pictures_need_more_cores(bench: Bench) -> None:
    plan = bench.plan()
    small = replace(plan, services=(camera(width="320", height="240", freq="10"),))
    large = replace(plan, services=(camera(width="1280", height="720", freq="30"),))
    assert cores_needed(plan) < cores_needed(small) < 0.5 < 1 < cores_needed(large)
    assert cores_needed(replace(small, clock="lockstep")) == 1.0
    endless = replace(plan, services=(camera(width="nan", height="240", freq="inf"),))
    assert cores_needed(endless) == cores_needed(plan)


@given(
    jobs=st.lists(st.tuples(st.floats(0.1, 9), st.floats(0.1, 4)), min_size=1, max_size=12), capacity=st.floats(0.5, 4)
)
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
def test_places_are_never_given_twice(needs: list[float], capacity: float) -> None:
    taken = {"now": 0.0, "most": 0.0}

    async def one(places: Places, need: float) -> None:
        async with places.take(need):
            taken["now"] += min(need, capacity)
            taken["most"] = max(taken["most"], taken["now"])
            await asyncio.sleep(0)
            taken["now"] -= min(need, capacity)

    async def all_() -> None:
        places = Places(capacity)
        await asyncio.gather(*(one(places, need) for need in needs))

    asyncio.run(all_())
    assert taken["most"] <= capacity + 1e-6


def test_a_place_is_free_again_after_an_interrupt() -> None:
    async def scene() -> bool:
        places = Places(1)
        async with places.take(1):
            waiting = asyncio.ensure_future(take(places))
            await asyncio.sleep(0)
            waiting.cancel()
        async with asyncio.timeout(5), places.take(1):
            return True

    async def take(places: Places) -> None:
        async with places.take(1):
            pass

    assert asyncio.run(scene())


def test_history_is_kept_and_survives_damage(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "state" / "history.jsonl"
    outcomes = bench.run(bench.plan(slug="a"), bench.plan(slug="b", judge=BROKEN))
    added = History(path)
    added.add([(o.slug, o) for o in outcomes])
    assert not path.exists()
    added.save()
    with path.open("a") as file:
        file.write('{"when": 1, "spec"')
    history = History(path)
    a, b = outcomes
    assert a.setup_s is not None and a.execution_s is not None
    assert history.seconds(a.spec, "a", a.backend, a.clock) == pytest.approx(a.setup_s + a.execution_s)
    assert history.seconds(b.spec, "b", b.backend, b.clock) is None
    assert json.loads(path.read_text().splitlines()[0])["test"] == "a"


def test_no_place_for_history_is_no_problem(tmp_path: Path, bench: Bench) -> None:
    (tmp_path / "file").touch()
    history = History(tmp_path / "file" / "history.jsonl")
    history.add([(o.slug, o) for o in bench.run(bench.plan())])
    history.save()
    assert len(history.runs) == 1


LINE = {
    "when": 1, "spec": "s", "test": "t", "level": "sil", "backend": "process", "clock": "realtime",
    "outcome": "passed", "setup_s": 1.0, "execution_s": 2.0,
}  # fmt: skip


@pytest.mark.parametrize("change", [{"spec": ["s"]}, {"setup_s": math.inf}, {"setup_s": math.nan}, {"execution_s": -1}])
def test_lines_of_history_that_no_run_wrote_are_left_out(tmp_path: Path, change: dict[str, object]) -> None:
    path = tmp_path / "history.jsonl"
    path.write_text("".join(f"{line}\n" for line in (json.dumps(LINE), json.dumps({**LINE, **change}), "[" * 100_000)))
    history = History(path)
    assert history.times([("s", "t")], "process") == {"t": [(1.0, 2.0)]}


def test_a_long_history_with_bytes_that_are_no_text_is_shortened(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "history.jsonl"
    path.write_bytes((json.dumps(LINE).encode() + b"\n") * 30_000 + b"\xff\xfe\n")
    history = History(path)
    history.add([(o.slug, o) for o in bench.run(bench.plan(slug="t"))])
    history.save()
    assert 15_000 < len(path.read_bytes().splitlines()) < 15_010
    assert len(History(path).runs) > 15_000


def test_a_user_without_a_home_has_no_history(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("HOME", "DODO_HISTORY", "XDG_STATE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("os.getuid", lambda: 3_999_999_999)
    history = History()
    history.save()
    assert history.runs == []
