"""Projects are removed from an engine that may still be busy with what has ended."""

from typing import Any

import pytest
from docker.errors import APIError, NotFound

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
    monkeypatch.setattr(cleanup.time, "sleep", found.append)
    return found


def test_what_is_refused_at_first_is_removed(rests: list[float]) -> None:
    engine = Engine(*[APIError("network has active endpoints")] * 2)
    assert cleanup.remove_project(engine, "dodo-x") == 1
    assert (engine.things, rests) == ([], [0.5, 1.0])


def test_what_is_refused_for_long_is_an_error(rests: list[float]) -> None:
    engine = Engine(*[APIError("network has active endpoints")] * 4)
    with pytest.raises(APIError, match="active endpoints"):
        cleanup.remove_project(engine, "dodo-x")
    assert rests == [0.5, 1.0, 2.0]


def test_what_earlier_runs_left_is_not_waited_for(rests: list[float]) -> None:
    with pytest.raises(APIError):
        cleanup.remove_project(Engine(APIError("network has active endpoints")), "dodo-x", rests_s=())
    assert rests == []


def test_an_engine_that_does_not_answer_is_not_waited_for(rests: list[float]) -> None:
    with pytest.raises(ConnectionError):
        cleanup.remove_project(Engine(ConnectionError("it has stopped")), "dodo-x")
    assert rests == []


def test_what_is_gone_already_is_no_problem(rests: list[float]) -> None:
    assert cleanup.remove_project(Engine(NotFound("gone")), "dodo-x") == 0
    assert rests == []


def test_endpoints_of_containers_that_could_not_start_are_removed(rests: list[float]) -> None:
    engine = Engine(APIError("network has active endpoints"))
    engine.things[0].endpoints = {"ep-1": {"Name": "dodo-x-driver-1"}}
    assert cleanup.remove_project(engine, "dodo-x") == 1
    assert (engine.things, rests) == ([], [])
