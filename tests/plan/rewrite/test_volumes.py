"""Volumes of copied services."""

from typing import Any

import pytest

from dodo_dsl.plan.rewrite.volumes import own_mounts, own_volumes, renamed
from tests.plan.rewrite.copies import copy

TMP = {"type": "volume", "source": "tmp", "target": "/t", "volume": {"nocopy": True}}


@pytest.mark.parametrize(
    ("volumes", "own", "on_host"),
    [
        (["./a:/a:ro"], ["./a:/a:ro"], ["./a:/a:ro"]),
        (["/tmp:/tmp"], ["tmp:/tmp:nocopy"], ["/tmp:/tmp"]),
        (["/tmp:/t:ro,z"], ["tmp:/t:ro,nocopy"], ["/tmp:/t:ro,z"]),
        (["/tmp/od4:/tmp/od4"], ["tmp:/tmp:nocopy"], ["/tmp/od4:/tmp/od4"]),
        (["/tmp/.X11-unix:/tmp/.X11-unix"], ["/tmp/.X11-unix:/tmp/.X11-unix"], ["/tmp/.X11-unix:/tmp/.X11-unix"]),
        (["/dev/shm:/dev/shm"], None, ["/dev/shm:/dev/shm"]),
        (["tmp:/a", "report:/b:ro"], ["application-tmp:/a", "application-report:/b:ro"], None),
        ([{"type": "bind", "source": "/tmp", "target": "/t"}], [TMP], None),
        (
            [{"type": "volume", "source": "tmp", "target": "/a"}],
            [{"type": "volume", "source": "application-tmp", "target": "/a"}],
            None,
        ),
        (["/tmp:/tmp", "/tmp/x:/tmp/x"], ["tmp:/tmp:nocopy"], None),
    ],
)
def test_mounts(volumes: list[Any], own: list[Any] | None, on_host: list[Any] | None) -> None:
    isolated = copy({"volumes": list(volumes)})
    own_mounts(isolated)
    assert isolated.service.get("volumes") == own
    if on_host is not None:
        host = copy({"volumes": list(volumes)}, isolation="host")
        own_mounts(host)
        assert host.service["volumes"] == on_host


def test_without_volumes() -> None:
    own = copy({"volumes": None})
    own_mounts(own)
    assert own.changes == []


def test_top_level_volumes() -> None:
    changes: list[str] = []
    written = {"a": None, "tmp": {"name": "x", "driver": "local"}, "shared": {"name": "y", "external": True}}
    assert own_volumes(written, changes) == {
        "a": None,
        "application-tmp": {"driver": "local"},
        "shared": {"name": "y", "external": True},
    }
    assert changes == ["volume application-tmp: name removed, each test has its own"]
    assert own_volumes(None, changes) == {}
    assert (renamed("report"), renamed("a")) == ("application-report", "a")
