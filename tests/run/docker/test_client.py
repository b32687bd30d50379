"""The client of an engine on a TCP port, as Docker-in-Docker has it: with and without TLS, and what is missing."""

import pytest

from dodo_dsl.run.docker.client import NoEngine, connect


@pytest.fixture(autouse=True)
def only_these_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DOCKER_HOST", "DOCKER_TLS_VERIFY", "DOCKER_CERT_PATH"):
        monkeypatch.delenv(name, raising=False)


def test_in_a_job_the_way_out_is_a_service(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOCKER_HOST", "tcp://127.0.0.1:9")
    with pytest.raises(NoEngine, match=r"Connection refused.*in a job of GitLab as its service"):
        connect()
