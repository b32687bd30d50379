"""The client of an engine on a TCP port, as Docker-in-Docker has it: with and without TLS, and what is missing."""

from pathlib import Path

import pytest

from dodo_dsl.run.docker.client import NoEngine, connect
from tests.run.docker.engine_stub import engine_stub, make_certificates


@pytest.fixture(autouse=True)
def only_these_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DOCKER_HOST", "DOCKER_TLS_VERIFY", "DOCKER_CERT_PATH"):
        monkeypatch.delenv(name, raising=False)


def test_in_a_job_the_way_out_is_a_service(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOCKER_HOST", "tcp://127.0.0.1:9")
    with pytest.raises(NoEngine, match=r"Connection refused.*in a job of GitLab as its service"):
        connect()


def test_tls_trusts_the_engine_s_own_authority(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever certificates the machine's other clients trust."""
    certificates = make_certificates(tmp_path / "certs")
    monkeypatch.setenv("REQUESTS_CA_BUNDLE", "/dev/null")
    with engine_stub(certificates) as host:
        monkeypatch.setenv("DOCKER_HOST", host)
        with pytest.raises(NoEngine):
            connect()
        monkeypatch.setenv("DOCKER_TLS_VERIFY", "1")
        monkeypatch.setenv("DOCKER_CERT_PATH", str(certificates))
        connect().close()
