"""The Plans of a run: each test as many times as it is repeated, and for any rig of its pool."""

from collections.abc import Sequence
from dataclasses import replace

from dodo_dsl.plan.model import Plan


def runs(plans: Sequence[Plan], repeat: int) -> list[tuple[Plan, str]]:
    """Each Plan ``repeat`` times with its slug, round by round; from the second on, its name and slug say which."""
    return [(_repetition(plan, number), plan.slug) for number in range(1, repeat + 1) for plan in plans]


def _repetition(plan: Plan, number: int) -> Plan:
    if number == 1:
        return plan
    name, slug = f"[run={number}]", f"--run-{number}"
    pool = plan.pool and replace(plan.pool, name=plan.pool.name + name, slug=plan.pool.slug + slug)
    return replace(plan, name=plan.name + name, slug=plan.slug + slug, pool=pool)


def pooled(plans: Sequence[Plan]) -> list[tuple[Plan, ...]]:
    """The Plans of each test, one for each rig of its pool, of which one is to be run; in the order given."""
    groups: dict[str, list[Plan]] = {}
    for plan in plans:
        groups.setdefault(named(plan).slug, []).append(plan)
    return [tuple(group) for group in groups.values()]


def named(plan: Plan) -> Plan:
    """The Plan under the name of its test, whichever rig it is for."""
    return replace(plan, name=plan.pool.name, slug=plan.pool.slug) if plan.pool else plan
