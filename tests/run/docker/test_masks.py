"""What an application's mounts do not show of the tests."""

from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.application.host_paths import HostPaths
from dodo_dsl.run.docker.compose import absent, masks

HIDDEN = [Path("/team/tests"), Path("/team/.git")]
BOUND = {"bound": {"driver_opts": {"type": "none", "o": "bind,ro", "device": "/team"}}, "own": {}}


@pytest.mark.parametrize(
    ("volume", "targets"),
    [
        ({"type": "bind", "source": "/team", "target": "/app"}, ["/app/tests", "/app/.git"]),
        ({"type": "bind", "source": "/", "target": "/host"}, ["/host/team/tests", "/host/team/.git"]),
        ({"type": "bind", "source": "/team/tests", "target": "/t"}, ["/t"]),
        ({"type": "bind", "source": "/team/tests/truths/a.json", "target": "/a.json"}, ["/a.json"]),
        ({"type": "bind", "source": "/team/testsuite", "target": "/t"}, []),
        ({"type": "volume", "source": "bound", "target": "/b"}, ["/b/tests", "/b/.git"]),
        ({"type": "volume", "source": "own", "target": "/b"}, []),
        ({"type": "volume", "target": "/b"}, []),
        ({"type": "tmpfs", "target": "/b"}, []),
    ],
)
def test_what_is_hidden(volume: dict[str, Any], targets: list[str]) -> None:
    found = masks({"volumes": [volume]}, BOUND, HIDDEN, Path())
    assert found == [{"type": "tmpfs", "target": target, "read_only": True} for target in targets]


def test_masks_do_not_lie_in_one_another() -> None:
    hidden = [Path("/team/tests/dodo-report"), Path("/team/tests")]
    found = masks({"volumes": [{"type": "bind", "source": "/team", "target": "/app"}]}, {}, hidden, Path())
    assert [mask["target"] for mask in found] == ["/app/tests"]


def test_an_empty_file_lies_over_a_file(tmp_path: Path) -> None:
    (tmp_path / "truth.json").touch()
    volumes = [{"type": "bind", "source": str(tmp_path), "target": "/app"}]
    volumes += [{"type": "bind", "source": str(tmp_path / "truth.json"), "target": "/t"}]
    found = masks({"volumes": volumes}, {}, [tmp_path / "truth.json"], Path("/empty"))
    expected = [{"type": "bind", "source": "/empty", "target": t, "read_only": True} for t in ("/app/truth.json", "/t")]
    assert found == expected


def test_what_is_not_there_is_an_empty_folder_and_is_not_made(tmp_path: Path) -> None:
    """But for what the engine is told not to make, and what dodo.yml lets an application write to."""
    (tmp_path / "there").mkdir()
    (tmp_path / "link").symlink_to("nowhere")
    names = ("gone", "there", "link", "allowed/gone")
    binds = [{"type": "bind", "source": f"{tmp_path}/{name}", "target": f"/{name}"} for name in names]
    made = [{**volume, "bind": {"create_host_path": True}} for volume in binds]
    volumes = [*made, {**binds[0], "target": "/asked", "bind": {}}, {"type": "volume", "source": "v", "target": "/v"}]
    paths = HostPaths(tmp_path, (tmp_path,), (tmp_path / "allowed",))
    allowed = HostPaths(tmp_path / "x", (tmp_path / "x",), (tmp_path,))
    targets = [[mask["target"] for mask in absent({"volumes": volumes}, seen)] for seen in (paths, allowed)]
    assert targets == [["/gone", "/allowed/gone"], []]
    assert [mask["target"] for mask in absent({"volumes": volumes}, paths, always=True)] == [
        "/gone",
        "/allowed/gone",
        "/asked",
    ]
