"""Names of services, and the services that they use."""

from pathlib import Path

import pytest

from dodo_dsl.check.service_rules import check_services
from tests.check.contexts import context, found


def test_an_unknown_service(tmp_path: Path) -> None:
    (problem,) = check_services(context("evaluation: {track: {uses: colision}}\n", tmp_path))
    assert (problem.rule, problem.message) == ("unknown-service", "unknown service 'colision'")
    assert problem.hint == "did you mean 'collision'?"


@pytest.mark.parametrize("name", ["sandbox", "dodo-clock"])
def test_a_reserved_name(name: str, tmp_path: Path) -> None:
    example = f"evaluation: {{{name}: {{uses: collision, with: {{goal: finish}}}}}}\n"
    expected = [("service-reserved", f"the name '{name}' is reserved for DoDo's own services")]
    assert found(check_services, example, tmp_path) == expected


def test_a_name_of_another_layer(tmp_path: Path) -> None:
    example = "evaluation: {camera: {uses: collision, with: {goal: finish}}}\n"
    expected = [("service-taken", "the name 'camera' is already used in layer environment")]
    assert found(check_services, example, tmp_path) == expected
