"""Paths of the host that an application may read and mount."""

from pathlib import Path

import pytest

from dodo_dsl.application.access.host_paths import HostPaths, repository


@pytest.fixture
def paths(tmp_path: Path) -> HostPaths:
    team = tmp_path / "team"
    (team / "app").mkdir(parents=True)
    (team / "app" / "link").symlink_to("/etc")
    (team / "app" / "inner").symlink_to("../maps")
    return HostPaths(team / "app", (team,), (Path("/etc/ros"),))


@pytest.mark.parametrize(
    "path", [".", "x", "../maps", "./a/../b", "inner/x", "/etc/ros", "/etc/ros/x.yml", "a ${X} b", "${X}"]
)
def test_own_files(paths: HostPaths, path: str) -> None:
    assert paths.file_problem(path) == ""


@pytest.mark.parametrize(
    "path", ["..", "../..", "/", "/etc/rosx", "~", "~/x", "link/passwd", "/opt/x", "../maps/../.."]
)
def test_files_of_others(paths: HostPaths, path: str) -> None:
    assert (paths.file_problem(path) == "") == (path == "..")  # the repository itself is one of its folders


def test_links_are_named(paths: HostPaths) -> None:
    assert paths.file_problem("link/passwd") == (
        "'link/passwd' is a symbolic link to '/etc/passwd', outside the repository"
    )


@pytest.mark.parametrize(
    "path", ["/opt/models", "/srv", "/mnt/x", "/data", "/home/team/maps", "/root/x", "/tmp", "/dev/x"]
)
def test_folders_that_may_be_mounted(paths: HostPaths, path: str) -> None:
    assert paths.mount_problem(path, False) == ("", "")


@pytest.mark.parametrize("path", ["/usr/share/x", "/etc/localtime", "/run/udev"])
def test_folders_that_may_be_read(paths: HostPaths, path: str) -> None:
    assert paths.mount_problem(path, True) == ("", "")
    assert paths.mount_problem(path, False)[1] == "mount it read-only (:ro)"


@pytest.mark.parametrize(
    "path",
    [
        *("/etc", "/home", "/home/team", "/home/team/.ssh", "/root/.docker/config.json", "/var/lib/x", "/builds/other"),
        *("../..", "link", "/optional", "~", "/opt/../etc"),
    ],
)
def test_folders_that_may_not(paths: HostPaths, path: str) -> None:
    assert paths.mount_problem(path, True)[0]


def test_the_repository(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b" / "c"
    folder.mkdir(parents=True)
    assert repository(folder) == (folder,)
    (tmp_path / "a" / "dodo.yml").touch()
    assert repository(folder) == (tmp_path / "a",)
    (folder.parent / ".git").mkdir()
    assert repository(folder) == (folder.parent, tmp_path / "a")
