"""The client of an engine on a TCP port, as Docker-in-Docker has it: with and without TLS, and what is missing."""

import contextlib
import shutil
from pathlib import Path

import pytest

from dodo_dsl.run.docker.client import NoEngine, connect
from tests.run.docker.engine_stub import VERSION, engine_stub, make_certificates

needs_openssl = pytest.mark.skipif(not shutil.which("openssl"), reason="there is no openssl")


@pytest.fixture(autouse=True)
def only_these_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DOCKER_HOST", "DOCKER_TLS_VERIFY", "DOCKER_CERT_PATH", "GITLAB_CI"):
        monkeypatch.delenv(name, raising=False)


@needs_openssl
def test_an_engine_with_tls_is_trusted_by_its_own_authority(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Whatever authorities the runner names for the web."""
    own, other = make_certificates(tmp_path / "own"), make_certificates(tmp_path / "other")
    monkeypatch.setenv("REQUESTS_CA_BUNDLE", str(other / "ca.pem"))
    monkeypatch.setenv("DOCKER_TLS_VERIFY", "1")
    with engine_stub(own) as host:
        monkeypatch.setenv("DOCKER_HOST", host)
        monkeypatch.setenv("DOCKER_CERT_PATH", str(own))
        with contextlib.closing(connect()) as client:
            assert client.version()["Version"] == VERSION["Version"]
        monkeypatch.setenv("DOCKER_CERT_PATH", str(other))
        with pytest.raises(NoEngine, match="certificate verify failed"):
            connect()


def test_in_a_job_the_way_out_is_a_service(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOCKER_HOST", "tcp://127.0.0.1:9")
    monkeypatch.setenv("GITLAB_CI", "true")
    with pytest.raises(NoEngine, match=r"Connection refused.*give this job the service that is the engine"):
        connect()
