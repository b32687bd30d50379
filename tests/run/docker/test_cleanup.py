"""Projects are removed from an engine that may still be busy with what has ended."""

import contextlib
from pathlib import Path
from typing import Any

import pytest
from docker.errors import APIError, NotFound

from dodo_dsl.run import leases
from dodo_dsl.run.docker import cleanup


class Thing:
    """A container, network or volume whose removal raises given errors first."""

    def __init__(self, engine: "Engine", *errors: Exception) -> None:
        self._engine, self._errors = engine, list(errors)
        self.endpoints: dict[str, dict[str, str]] = {}

    def reload(self) -> None:
        self.attrs = {"Containers": self.endpoints}

    def disconnect(self, name: str, force: bool) -> None:
        assert force
        self.endpoints = {key: about for key, about in self.endpoints.items() if about["Name"] != name}

    def remove(self, **_: object) -> None:
        if self._errors:
            raise self._errors.pop(0)
        self._engine.things.remove(self)


class Engine:
    """An engine with a network."""

    def __init__(self, *errors: Exception) -> None:
        self.things = [Thing(self, *errors)]
        self.networks = self
        self.containers = self.volumes = NOTHING

    def list(self, **_: object) -> list[Thing]:
        return list(self.things)


class Nothing:
    def list(self, **_: object) -> list[Thing]:
        return []


NOTHING: Any = Nothing()


@pytest.fixture
def rests(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """How long it waited each time."""
    found: list[float] = []
    monkeypatch.setattr(cleanup.time, "sleep", lambda rest_s: found.append(rest_s) if rest_s else None)
    return found


BUSY = APIError("network has active endpoints")


@pytest.mark.parametrize(
    ("errors", "more", "expected", "waited"),
    [
        ([BUSY] * 2, {}, 1, [0.5, 1.0]),
        ([BUSY] * 4, {}, APIError, [0.5, 1.0, 2.0]),
        ([BUSY], {"rests_s": ()}, APIError, []),
        ([ConnectionError("it has stopped")], {}, ConnectionError, []),
        ([NotFound("gone")], {}, 0, []),
    ],
    ids=["refused at first", "refused for long", "of an earlier run", "the engine does not answer", "gone already"],
)
def test_what_cannot_be_removed_at_once(
    errors: list[Exception], more: dict[str, Any], expected: Any, waited: list[float], rests: list[float]
) -> None:
    with contextlib.nullcontext() if isinstance(expected, int) else pytest.raises(expected):
        assert cleanup.remove_project(Engine(*errors), "dodo-x", **more) == expected
    assert rests == waited


def test_what_a_killed_run_left_stays_on_record_until_it_is_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DODO_LEASES", str(tmp_path))
    for test in "ab":
        lease = leases.try_lease(f"{leases.PROJECT}dodo-{test}", {"test": test})
        assert lease is not None
        lease.leave()
    engine = Engine(BUSY)
    blocked = "a: project dodo-a: network has active endpoints"
    assert cleanup.reap_projects(engine) == (["b: 1 containers, networks and volumes"], [blocked])
    assert [lease.name for lease in leases.orphans(leases.PROJECT)] == [f"{leases.PROJECT}dodo-a"]


def test_endpoints_of_containers_that_could_not_start_are_removed() -> None:
    engine = Engine()
    network = engine.things[0]
    network.endpoints = {"ep-1": {"Name": "dodo-x-driver-1"}}
    assert cleanup.remove_project(engine, "dodo-x") == 1
    assert (engine.things, network.endpoints) == ([], {})
