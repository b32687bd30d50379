"""The order of tests, and the cores that they need and share."""

import os
from dataclasses import replace
from pathlib import Path

from dodo_dsl.run.backends import Job
from dodo_dsl.run.schedule import Schedule
from tests.run.scripted import plan


def test_the_longest_come_first_and_equal_ones_keep_their_order() -> None:
    given = [
        Job(plan(slug, timeout_s=seconds), Path(), Path())
        for slug, seconds in (("a", 1.0), ("b", 3.0), ("c", 2.0), ("d", 3.0))
    ]
    assert [job.plan.slug for job in Schedule(1).ordered(given)] == ["b", "d", "c", "a"]
    known = Schedule(1, lambda job: {"a": 9.0, "b": 0.5}.get(job.plan.slug))
    assert [job.plan.slug for job in known.ordered(given)] == ["a", "d", "c", "b"]


def test_a_number_of_jobs_counts_instead_of_cores() -> None:
    assert (Schedule(3).capacity, Schedule(3).need(Job(plan(rig="kiwi"), Path(), Path()))) == (3, 1)
    cores = Schedule(None)
    assert cores.capacity == len(os.sched_getaffinity(0))
    assert [cores.need(Job(replace(plan(), rig=rig), Path(), Path())) for rig in ("", "kiwi")] == [1, 2]
