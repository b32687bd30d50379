"""Services in the layers of their manifests."""

from pathlib import Path

from dodo_dsl.check.service_rules import check_layers
from tests.check.contexts import context, found


def test_a_service_in_another_layer(tmp_path: Path) -> None:
    (problem,) = check_layers(context("environment: {pose: {uses: integrator}}\n", tmp_path))
    assert (problem.rule, problem.message) == ("wrong-layer", "service 'integrator' does not fit layer environment")
    assert problem.hint == "move it to action"


def test_services_in_their_layers(tmp_path: Path) -> None:
    assert found(check_layers, "", tmp_path) == []
