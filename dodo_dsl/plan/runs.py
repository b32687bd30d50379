"""The Plans of a run: each test as many times as it is repeated, and for any rig of its pool.

Plans of a test on a pool, one for each rig, are taken together.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from dodo_dsl.plan.model import Plan


@dataclass(frozen=True)
class Run:
    """One repetition of a test; ``test`` is the slug of all its repetitions, and of the compiled folder."""

    plan: Plan
    test: str


def runs(plans: Sequence[Plan], repeat: int) -> list[Run]:
    """Each Plan ``repeat`` times, round by round; from the second round on, name and slug carry its number."""
    return [Run(_repetition(plan, number), plan.slug) for number in range(1, repeat + 1) for plan in plans]


def _repetition(plan: Plan, number: int) -> Plan:
    if number == 1:
        return plan
    pool = (
        replace(plan.pool, name=_name(plan.pool.name, number), slug=_slug(plan.pool.slug, number))
        if plan.pool
        else None
    )
    return replace(plan, name=_name(plan.name, number), slug=_slug(plan.slug, number), pool=pool)


def _name(name: str, number: int) -> str:
    return f"{name}[run={number}]"


def _slug(slug: str, number: int) -> str:
    return f"{slug}--run-{number}"


def pooled(plans: Sequence[Plan]) -> list[tuple[Plan, ...]]:
    """The Plans of each test, of which one is to be run, in the order given."""
    groups: dict[str, list[Plan]] = {}
    for plan in plans:
        groups.setdefault(named(plan).slug, []).append(plan)
    return [tuple(group) for group in groups.values()]


def by_test(plans: Sequence[Plan]) -> list[Plan]:
    """One Plan for each test, under the test's name."""
    return [named(group[0]) for group in pooled(plans)]


def named(plan: Plan) -> Plan:
    """The Plan under the name of its test, whichever rig it is for."""
    return replace(plan, name=plan.pool.name, slug=plan.pool.slug) if plan.pool else plan
