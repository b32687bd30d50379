"""An engine with a network and files of its own, as in Docker-in-Docker: a test says what the engine does not see."""

import pytest

from tests.docker.compose import Crate
from tests.docker.own_engine import own_engine

pytestmark = [pytest.mark.slow, pytest.mark.proof]


@pytest.mark.parametrize("tls", [False, True], ids=["plain", "tls"])
def test_a_test_ends_before_anything_is_pulled(tls: bool, crate: Crate, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = crate.bench.folder
    job = crate.job("far")
    with own_engine([folder.parent], tls) as variables, monkeypatch.context() as patch:
        for name, value in variables.items():
            patch.setenv(name, value)
        outcome = crate.run(job)["far"]
        assert crate.left() == []
        told = f"the Docker engine at {variables['DOCKER_HOST']} does not see '{folder}"
        assert (outcome.outcome, outcome.reason[: len(told)]) == ("error", told)
