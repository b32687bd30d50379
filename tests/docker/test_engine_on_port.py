"""Tests in containers of an engine that is reached by a TCP port with TLS, as in Docker-in-Docker."""

import shutil
from pathlib import Path

import pytest

from dodo_dsl.run import capabilities
from tests.docker.compose import Crate
from tests.docker.engine_proxy import EngineProxy, engine_socket
from tests.run.docker.engine_stub import make_certificates
from tests.run.faults import FAULTS

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]


def test_both_sides_of_a_verdict(crate: Crate, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if (engine := engine_socket()) is None or not shutil.which("openssl"):
        pytest.skip("there is no engine with a socket here, or no openssl")
    certificates = make_certificates(tmp_path / "certs")
    names = ("neighbour", "killed")
    jobs = [crate.job(name, f.judge, f.application, f.environment) for name in names for f in [FAULTS[name]]]
    with EngineProxy(engine, certificates=certificates) as proxy, monkeypatch.context() as patch:
        for name, value in proxy.variables.items():
            patch.setenv(name, value)
        (found, *rest) = capabilities.docker_engine()
        assert (found.text.endswith(" with TLS"), proxy.variables["DOCKER_HOST"] in found.text) == (True, True)
        assert [finding.state for finding in rest] == ["ok"], "the engine is on this machine"
        outcomes = crate.run(*jobs)
        assert crate.left() == []
    assert [outcomes[name].outcome for name in names] == ["passed", "failed"], outcomes
