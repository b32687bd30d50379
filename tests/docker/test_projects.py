"""What killed runs left on a real engine: all that can go goes, whatever of it cannot."""

import contextlib
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.run import capabilities, leases
from dodo_dsl.run.docker.cleanup import PROJECT_LABEL, reap_projects
from dodo_dsl.run.docker.client import connect

pytestmark = pytest.mark.engine


@pytest.fixture
def client(base_image: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    with contextlib.closing(connect()) as made:
        yield made


def leftover(client: Any, test: str) -> tuple[Any, Any]:
    """Network and volume of a killed run's project, with the record of its lease."""
    project = f"dodo-{test}-{secrets.token_hex(3)}"
    lease = leases.try_lease(f"{leases.PROJECT}{project}", {"test": test})
    assert lease is not None
    lease.leave()
    labels = {PROJECT_LABEL: project}
    return client.networks.create(project, labels=labels), client.volumes.create(project, labels=labels)


def test_a_strangers_container_on_a_leftover_network_blocks_nothing_else(client: Any, base_image: str) -> None:
    blocked, volume = leftover(client, "a-blocked")
    free, free_volume = leftover(client, "b-free")
    stranger = client.containers.run(base_image, ["sleep", "600"], detach=True, network=blocked.name, init=True)
    try:
        reaped = reap_projects(client)
        names = {n.name for n in client.networks.list()} | {v.name for v in client.volumes.list()}
        assert names & {blocked.name, volume.name, free.name, free_volume.name} == {blocked.name}
        assert reaped.removed == ["b-free: 2 containers, networks and volumes"]
        (left,) = reaped.left
        assert left.startswith(f"a-blocked: project {blocked.name}: ") and "has active endpoints" in left
        assert capabilities.clean().left == reaped.left, "it is tried again, and said again"
        stranger.reload()
        assert stranger.status == "running"
    finally:
        stranger.remove(force=True)
    assert capabilities.clean().removed == ["a-blocked: 1 containers, networks and volumes"]
    assert list(leases.lease_folder().glob("*.lease")) == []
