"""Volumes of copied services."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.plan.rewrite.service_copy import Setting
from dodo_dsl.plan.rewrite.volumes import FileCopies, own_mounts, own_name, own_volumes
from tests.plan.rewrite.copies import FOLDER, copy, project

PROJECT = project(Setting(140, "network", FOLDER))

TMP = {"type": "volume", "source": "tmp", "target": "/t", "volume": {"nocopy": True}}


@pytest.mark.parametrize(
    ("volumes", "own", "on_host"),
    [
        (["./a:/a:ro"], ["./a:/a:ro"], ["./a:/a:ro"]),
        (["/tmp:/tmp"], ["tmp:/tmp:nocopy"], ["/tmp:/tmp"]),
        (["/tmp:/t:ro,z"], ["tmp:/t:ro,nocopy"], ["/tmp:/t:ro,z"]),
        (["/tmp/od4:/tmp/od4"], ["tmp:/tmp:nocopy"], ["/tmp:/tmp"]),
        (["/tmp/.X11-unix:/tmp/.X11-unix"], ["/tmp/.X11-unix:/tmp/.X11-unix"], ["/tmp/.X11-unix:/tmp/.X11-unix"]),
        (["/dev/shm:/dev/shm"], None, ["/dev/shm:/dev/shm"]),
        (["tmp:/a", "report:/b:ro"], ["application-tmp:/a", "application-report:/b:ro"], None),
        ([{"type": "bind", "source": "/tmp", "target": "/t"}], [TMP], None),
        (
            [{"type": "volume", "source": "tmp", "target": "/a"}],
            [{"type": "volume", "source": "application-tmp", "target": "/a"}],
            None,
        ),
        (["/tmp:/tmp", "/tmp/x:/tmp/x"], ["tmp:/tmp:nocopy"], ["/tmp:/tmp"]),
        (["files-0:/a"], ["application-files-0:/a"], ["application-files-0:/a"]),
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
    shared = {"name": "y", "external": True}
    written: dict[str, Any] = {"a": {"labels": ["x"]}, "tmp": {"name": "x", "driver": "local"}, "shared": shared}
    assert own_volumes(written, changes, PROJECT) == {
        "a": {},
        "application-tmp": {"driver": "local"},
        "shared": {"name": "y", "external": True},
    }
    assert changes == [
        "volume a: labels removed, programs of the host act on them",
        "volume application-tmp: name removed, each test has its own",
    ]
    assert own_volumes(None, changes, PROJECT) == {}
    assert (own_name("report"), own_name("a")) == ("application-report", "a")


@pytest.fixture
def team(tmp_path: Path) -> Path:
    """A repository with a folder, a file and a link within it."""
    (tmp_path / "team" / "data" / "sub").mkdir(parents=True)
    (tmp_path / "team" / "a.txt").touch()
    (tmp_path / "team" / "link").symlink_to("data")
    return tmp_path / "team"


def file_copies(team: Path, *services: list[Any], volumes: Any = None) -> FileCopies:
    paths = HostPaths(team, (team,), (team.parent / "allowed",))
    return FileCopies(paths, {}, [{"volumes": each} for each in services], volumes)


def mounts(team: Path, *services: list[Any], volumes: Any = None) -> list[Any]:
    """What becomes of the services' mounts, and the copies."""
    copies = file_copies(team, *services, volumes=volumes)
    found: list[Any] = []
    for each in services:
        made = copy({"volumes": each}, copies=copies)
        own_mounts(made)
        found.append(made.service["volumes"])
    return [*found, copies.sources]


@pytest.mark.parametrize(
    ("written", "own", "sources"),
    [
        ("./data:/d", "files-0:/d:nocopy", {"files-0": "./data"}),
        ("./data:/d:rw,z", "files-0:/d:nocopy", {"files-0": "./data"}),
        ("./link:/d", "files-0:/d:nocopy", {"files-0": "./link"}),
        ("./new:/d", "files-0:/d:nocopy", {"files-0": "./new"}),
        ("${D:-./data}:/d", "files-0:/d:nocopy", {"files-0": "${D:-./data}"}),
        ("./data:/d:ro", "./data:/d:ro", {}),
        ("./a.txt:/a.txt", "./a.txt:/a.txt:ro", {}),
        ("./a.txt:/a.txt:rw,Z", "./a.txt:/a.txt:Z,ro", {}),
        ("${UNKNOWN}:/d", "${UNKNOWN}:/d:ro", {}),
        ("/usr/share:/d:z", "/usr/share:/d:z,ro", {}),
        ("../allowed/x:/d", "../allowed/x:/d", {}),
        ("/dev/null:/d", "/dev/null:/d", {}),
        ("named:/d", "named:/d", {}),
        ("/d", "/d", {}),
    ],
)
def test_files_of_the_repository(written: str, own: str, sources: dict[str, str], team: Path) -> None:
    assert mounts(team, [written]) == [[own], sources]


def test_services_share_a_copy_and_nothing_beside_it(team: Path) -> None:
    found = mounts(team, ["./data:/d"], ["./data/:/e:ro", "./data/sub:/f:ro"], [".:/app"])
    assert found[:2] == [["files-0:/d:nocopy"], ["files-0:/e:ro,nocopy", "./data/sub:/f:ro"]]
    assert found[2:] == [["files-1:/app:nocopy"], {"files-0": "./data", "files-1": "."}]


def test_copies_of_long_forms_and_of_volumes(team: Path) -> None:
    bound = {"bound": {"driver_opts": {"o": "bind", "type": "none", "device": "./data"}, "labels": {"a": "b"}}}
    bind = {"type": "bind", "source": "./data", "target": "/d", "bind": {"create_host_path": True}}
    (own,), (volume,), sources = mounts(team, [bind], ["bound:/b:ro"], volumes=bound)
    assert own == {"type": "volume", "source": "files-0", "target": "/d", "volume": {"nocopy": True}}
    assert (volume, sources) == ("bound:/b:ro,nocopy", {"files-0": "./data", "bound": "./data"})
    whole = replace(PROJECT, copies=file_copies(team, [bind], ["bound:/b:ro"], volumes=bound))
    assert own_volumes(bound, [], whole) == {"bound": {}, "files-0": {}}


def test_volumes_that_nobody_knows_are_only_read() -> None:
    unknown = {"vol": {"driver_opts": {"o": "bind,rw", "type": "none", "device": "${X}"}}}
    assert own_volumes(unknown, [], PROJECT)["vol"]["driver_opts"]["o"] == "bind,ro"
