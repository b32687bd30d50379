"""Paths of the host that an application may read and mount."""

from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.application.access.host_paths import HostPaths, link_out, repository


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


@pytest.mark.parametrize("path", ["/tmp", "/dev/shm/x", "/dev/null", "/etc/ros", "/etc/ros/x"])
def test_what_may_be_written_to(paths: HostPaths, path: str) -> None:
    assert paths.mount_problem(path) == ("", "")
    assert paths.is_writable(path) and not paths.is_only_read(path)


@pytest.mark.parametrize("path", [".", "../maps", "inner", "/usr/share/x", "/etc/localtime", "/run/udev/data"])
def test_what_may_only_be_read(paths: HostPaths, path: str) -> None:
    assert paths.mount_problem(path) == ("", "")
    assert paths.is_only_read(path) and not paths.is_writable(path)


@pytest.mark.parametrize(
    "path",
    [
        *("/etc", "/home", "/home/team", "/home/team/.ssh", "/root/.docker/config.json", "/var/lib/x", "/builds/other"),
        *("../..", "link", "/optional", "~", "/opt/../etc", "/opt/models", "/srv", "/mnt/x", "/home/team/maps"),
        *("/run/udev", "/run/udev/control"),
        *("/tmp/x", "/dev/x", "~/x", "/usr/local", "/etc/ros/../passwd", "/usr/share/../../etc"),
    ],
)
def test_folders_that_may_not(paths: HostPaths, path: str) -> None:
    assert paths.mount_problem(path)[0] and not paths.is_writable(path)


def test_the_host_tmp_is_none_of_an_isolated_test(paths: HostPaths) -> None:
    isolated = replace(paths, tmp=False)
    assert all(isolated.mount_problem(path)[0] for path in ("/tmp", "/dev/shm"))


@pytest.mark.parametrize("spelling", ["link", "./link", "{}/app/link", "{}/app/./x/../link/.", "{}/maps/../app/link"])
def test_links_in_any_spelling(paths: HostPaths, spelling: str) -> None:
    text = spelling.format(paths.roots[0])
    said = f"'{text}' is a symbolic link to '/etc', outside the repository"
    assert paths.mount_problem(text) == (said, "put the files themselves in its place")
    assert paths.file_problem(text) == said


def test_what_lies_beside_a_link_is_where_it_leads(paths: HostPaths) -> None:
    text = f"{paths.folder}/link/../opt"
    assert paths.mount_problem(text)[0] == f"'{text}' is a symbolic link to '/opt', outside the repository"


@pytest.mark.parametrize("home", ["/", "", "/var"])
def test_homes_allow_nothing(paths: HostPaths, home: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", home)
    assert all(paths.mount_problem(path)[0] for path in ("/etc", "/var/lib/x", "/opt", "/root/x"))


def test_a_home_is_no_repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / ".git").mkdir()
    (tmp_path / "team").mkdir()
    assert repository(tmp_path / "team") == (tmp_path / "team",)


def test_links_that_leave_a_repository(tmp_path: Path) -> None:
    for name in ("team", "other"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "dodo.yml").touch()
    (tmp_path / "team" / "sub").symlink_to("../other")
    (tmp_path / "team" / "inner.yml").symlink_to("dodo.yml")
    assert link_out(tmp_path / "team" / "sub" / "dodo.yml") == str(tmp_path / "other" / "dodo.yml")
    assert not link_out(tmp_path / "team" / "inner.yml")
    assert not link_out(tmp_path / "other" / "dodo.yml")


def test_the_repository(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b" / "c"
    folder.mkdir(parents=True)
    assert repository(folder) == (folder,)
    (tmp_path / "a" / "dodo.yml").touch()
    assert repository(folder) == (tmp_path / "a",)
    (folder.parent / ".git").mkdir()
    assert repository(folder) == (folder.parent, tmp_path / "a")


def test_a_path_from_the_root_as_home_has_one_slash(tmp_path: Path) -> None:
    problem, _ = HostPaths(tmp_path, (tmp_path,)).mount_problem("//.ssh")
    assert problem == "'/.ssh' belongs to the host, so tests would share it"
