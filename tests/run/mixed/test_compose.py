"""Folders of services that no container of the application removes."""

import tempfile
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.run.docker.beside_processes import covers, uncovered


@pytest.mark.parametrize("own", [{"Mounts": [{"Destination": "/dev/shm"}]}, {"HostConfig": {"Tmpfs": {"/dev": ""}}}])
def test_what_is_mounted_over_shared_memory_is_named_where_the_test_needs_it(own: dict[str, Any]) -> None:
    (hidden,) = [mount["Destination"] for mount in own.get("Mounts", ())] or ["/dev"]
    container = {"Mounts": [], "HostConfig": {"Tmpfs": None}, **own}
    assert uncovered(container) == ""
    container["Mounts"] = [*container["Mounts"], {"Destination": "/dev/shm/folder-of-services"}]
    assert uncovered(container) == hidden
    assert uncovered({"Mounts": container["Mounts"][-1:], "HostConfig": {}}) == ""


def test_only_folders_are_covered() -> None:
    """A file in the place of a folder would keep the container from starting."""
    with tempfile.TemporaryDirectory(dir="/tmp") as name, tempfile.NamedTemporaryFile(dir="/tmp") as file:
        volume, cover = covers([Path(name), Path(file.name), Path("/tmp/there-is-none")])
        assert cover["target"] == f"{volume['target']}/{Path(name).name}"
        assert (volume["source"], volume["read_only"]) == ("tmp", True)
        assert covers([Path(name)])[0]["target"] != volume["target"]
    assert covers([Path("/tmp/there-is-none")]) == []
