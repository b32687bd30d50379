"""Tests that any rig of a pool may run: their Plans, one for each rig, taken together."""

from collections.abc import Sequence
from dataclasses import replace

from dodo_dsl.plan.model import Plan


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
