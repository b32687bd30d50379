"""What an application's mounts do not show of the tests, and what stands for folders that are not there."""

import asyncio
import json
import os
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.plan.model import Application
from dodo_dsl.run.application_files import hidden_paths
from dodo_dsl.run.docker.compose import Compose
from tests.application.compiled import compiled, repository

CREATES = '#!/bin/sh\nfor file in $(echo "$COMPOSE_FILE" | tr ":" " "); do last=$file; done\ncat "$last" > "$SEEN"\n'
"""A docker program that keeps the last of the files that it makes containers of."""


def masked(volumes: list[dict[str, Any]], folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The targets of empty folders that a service with mounts gets; ``{}`` in a source is the repository."""
    root = repository(folder, {"testsuite/x": "", "tests/truths/a.json": ""})
    (root / "link").symlink_to("nowhere")
    test = compiled(root, {"services": {"a": {"image": "x", "command": "--cid=111"}}}, paths=[str(folder / "allowed")])
    assert test.plan is not None, test.told
    program = folder / "bin" / "docker"
    program.parent.mkdir()
    program.write_text(CREATES.replace("$SEEN", str(folder / "seen")))
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}:{os.environ['PATH']}")
    made = Compose(test.plan, test.write(), root / "dodo-report" / "network", "dodo-t", print)
    made.services = {"a": {"volumes": [{**v, "source": v.get("source", "").format(root)} for v in volumes]}}
    asyncio.run(made.create(["10.213.0.0/28"], b"key"))
    mounts = json.loads((folder / "seen").read_text())["services"].get("a", {}).get("volumes", ())
    assert all((mount["type"], mount["read_only"]) == ("tmpfs", True) for mount in mounts)
    return [mount["target"] for mount in mounts]


def bind(source: str, target: str, made: bool = False) -> dict[str, Any]:
    return {
        "type": "bind",
        "source": source,
        "target": target,
        **({"bind": {"create_host_path": True}} if made else {}),
    }


@pytest.mark.parametrize(
    ("volume", "targets"),
    [
        (bind("{}", "/app"), {"/app/tests", "/app/.git", "/app/generated"}),
        (bind("{}/..", "/host"), {"/host/team/tests", "/host/team/.git", "/host/team/generated"}),
        (bind("{}/tests", "/t"), {"/t"}),
        (bind("{}/tests/truths/a.json", "/a.json"), {"/a.json"}),
        (bind("{}/testsuite", "/t"), set()),
        ({"type": "volume", "source": "own", "target": "/b"}, set()),
        ({"type": "tmpfs", "target": "/b"}, set()),
        (bind("{}/gone", "/gone", made=True), {"/gone"}),
        (bind("{}/gone", "/gone"), set()),
        (bind("{}/link", "/link", made=True), set()),
        (bind("{}/../allowed/gone", "/allowed", made=True), set()),
    ],
)
def test_what_is_hidden(
    volume: dict[str, Any], targets: set[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also what is not there, which the engine would make as root; but not what it is told not to make."""
    assert set(masked([volume], tmp_path, monkeypatch)) == targets


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
