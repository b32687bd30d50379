"""How long a pipeline takes with so many runners."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.emit.pipeline import Pipeline, forecast
from dodo_dsl.emit.pipeline_jobs import PipelineJob


def job(name: str, level: str = "sil", rig: str = "", gated: bool = False) -> PipelineJob:
    return PipelineJob(name, level, (rig or "sil",), gated, rig, 12, not rig, (name,))


def of(*jobs: PipelineJob) -> Pipeline:
    return Pipeline(("sil", "hil"), any(j.gated for j in jobs), {}, jobs)


@given(took=st.lists(st.floats(0, 600), min_size=1, max_size=30), runners=st.integers(1, 8), overhead=st.floats(0, 30))
@pytest.mark.thorough
def test_it_lies_between_the_bounds_of_list_scheduling(took: list[float], runners: int, overhead: float) -> None:
    """Graham's bounds: no less than an even share or the longest job, at most the share of the others plus the last."""
    times = {f"t{number}": seconds for number, seconds in enumerate(took)}
    found = forecast(of(*map(job, times)), times.__getitem__, runners, overhead)
    each = [seconds + overhead for seconds in took]
    assert found.work == pytest.approx(sum(each))
    least = max(sum(each) / runners, *each)
    assert least * (1 - 1e-9) <= found.seconds <= sum(each) / runners + max(each) * (1 - 1 / runners) + 1e-6
    if runners == 1:
        assert found.seconds == pytest.approx(sum(each))


def test_each_job_gets_the_first_runner_that_is_free() -> None:
    took = {"a": 10.0, "b": 2.0, "c": 5.0, "d": 4.0}
    found = forecast(of(*map(job, took)), took.__getitem__, 2, 1.0)
    assert (found.seconds, found.last) == (14.0, "d")  # a until 11, b until 3, c until 9, d until 14


def test_a_pool_takes_the_rig_that_is_free_first() -> None:
    took = {"on one": 10.0, "any": 4.0, "any again": 4.0}
    jobs = [job("on one", rig="one"), *(replace(job(name), pool=("one", "two")) for name in ("any", "any again"))]
    assert forecast(of(*jobs), took.__getitem__, 1, 1.0).seconds == 11.0, "both on the other, one after the other"
    assert forecast(of(*jobs[:2]), took.__getitem__, 1, 1.0).last == "on one"


def test_rigs_wait_for_the_gate_and_for_themselves() -> None:
    took = {"sim": 20.0, "first": 30.0, "second": 30.0, "other": 5.0}
    rigs = [job("first", "hil", "one", True), job("second", "hil", "one", True), job("other", "hil", "two", True)]
    found = forecast(of(job("sim"), *rigs), took.__getitem__, 8, 2.0)
    assert (found.seconds, found.last) == (22 + 2 + 2 * 32, "second")
