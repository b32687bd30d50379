"""When services of an application start, and what becomes of those that never may: without any process."""

from typing import Any

import pytest

from dodo_dsl.plan.model import COMPLETED, HEALTHY, STARTED, ApplicationService
from dodo_dsl.run.start_order import UNHEALTHY, Conditions, may_end, optional
from tests.run.scripted import run

DB = ApplicationService("db")


def app(condition: str, *optional: str) -> tuple[ApplicationService, ...]:
    return (ApplicationService("app", after={"db": condition}, optional=optional), DB)


async def unmet(conditions: Conditions, notes: list[str]) -> tuple[str, list[str]]:
    return await conditions.unmet("app", notes.append), notes


@pytest.mark.parametrize(
    ("condition", "what", "why"),
    [
        (STARTED, ("failed", "db"), "to start (depends_on), which could not be started"),
        (HEALTHY, ("decide", "db", HEALTHY, UNHEALTHY), "to be healthy (depends_on), which is unhealthy"),
        (COMPLETED, ("ended", "db", 3), "to end with exit code 0 (depends_on), which ended with exit code 3"),
        (COMPLETED, (), "to end with exit code 0 (depends_on), which did not within 600 s"),
    ],
)
def test_one_that_never_may_start_unless_the_other_is_optional(condition: str, what: tuple[Any, ...], why: str) -> None:
    async def waited(*optional: str) -> tuple[str, list[str]]:
        conditions = Conditions(app(condition, *optional))
        if what[:1] != ("failed",):
            conditions.decide("db", STARTED)
        if what:
            getattr(conditions, what[0])(*what[1:])
        return await unmet(conditions, [])

    told = f"it waits for 'db' {why}"
    assert run(waited()) == (told, [])
    assert run(waited("db")) == ("", [f"service 'app' starts all the same (required: false): {told}"])


def test_which_services_a_test_can_do_without() -> None:
    both = (*app(HEALTHY, "db"), ApplicationService("other", after={"db": COMPLETED}))
    assert (optional(app(HEALTHY, "db")), optional(app(HEALTHY)), optional(both)) == ({"db"}, set(), set())
    assert optional(app(STARTED, "db")) == set(), "its health is none of the others' matter"
    ends = [may_end(app(COMPLETED, *names), "db", code) for names in ((), ("db",)) for code in (0, 3)]
    assert (ends, may_end(app(HEALTHY, "db"), "db", 0)) == ([True, False, True, True], False)
