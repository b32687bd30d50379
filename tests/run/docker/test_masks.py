"""What an application's mounts do not show of the tests."""

from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.application.host_paths import HostPaths
from dodo_dsl.plan.model import Application
from dodo_dsl.run.application_files import hidden_paths
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
    found = masks({"volumes": [volume]}, BOUND, HIDDEN)
    assert found == [{"type": "tmpfs", "target": target, "read_only": True} for target in targets]


def test_masks_do_not_lie_in_one_another() -> None:
    hidden = [Path("/team/tests/dodo-report"), Path("/team/tests")]
    found = masks({"volumes": [{"type": "bind", "source": "/team", "target": "/app"}]}, {}, hidden)
    assert [mask["target"] for mask in found] == ["/app/tests"]


def test_folders_of_the_tests(tmp_path: Path) -> None:
    for name in ("tests", "generated/t", "dodo-report/t", ".git", "maps"):
        (tmp_path / name).mkdir(parents=True)
    application = Application("../..", (), hidden=("tests", "gone"))
    hidden = hidden_paths(application, tmp_path / "generated" / "t", tmp_path / "dodo-report" / "t")
    assert hidden == [tmp_path / name for name in ("tests", "generated", "dodo-report", ".git")]


def test_a_report_elsewhere_needs_no_mask(tmp_path: Path) -> None:
    (tmp_path / "team" / "generated" / "t").mkdir(parents=True)
    application = Application("../..", ())
    assert hidden_paths(application, tmp_path / "team" / "generated" / "t", tmp_path / "report") == [
        tmp_path / "team" / "generated"
    ]


def test_what_is_not_there_is_an_empty_folder_and_is_not_made(tmp_path: Path) -> None:
    """But for what the engine is told not to make, and what dodo.yml lets an application write to."""
    (tmp_path / "there").mkdir()
    (tmp_path / "link").symlink_to("nowhere")
    names = ("gone", "there", "link", "allowed/gone")
    binds = [{"type": "bind", "source": f"{tmp_path}/{name}", "target": f"/{name}"} for name in names]
    made = [{**volume, "bind": {"create_host_path": True}} for volume in binds]
    volumes = [*made, {**binds[0], "target": "/asked", "bind": {}}, {"type": "volume", "source": "v", "target": "/v"}]
    paths = HostPaths(tmp_path, (tmp_path,), (tmp_path / "allowed",), literal=True)
    allowed = HostPaths(tmp_path / "x", (tmp_path / "x",), (tmp_path,), literal=True)
    targets = [[mask["target"] for mask in absent({"volumes": volumes}, seen)] for seen in (paths, allowed)]
    assert targets == [["/gone", "/allowed/gone"], []]
    assert [mask["target"] for mask in absent({"volumes": volumes}, paths, always=True)] == [
        "/gone",
        "/allowed/gone",
        "/asked",
    ]
