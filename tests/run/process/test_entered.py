"""What a sandbox enters, as a word of its command line."""

import asyncio
import os
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.run.process.sandbox_client import SandboxClient
from dodo_dsl.run.process.side import ProcessSide
from dodo_dsl.run.process.slot import Entered, Slot
from dodo_dsl.run.service_protocol import Reports
from dodo_dsl.run.sides import WatchedServices
from tests.run.scripted import plan


def test_it_is_read_as_it_was_written(tmp_path: Path) -> None:
    entered = Entered.with_own(12, tmp_path / "a b", Path("/tmp/../usr"))
    assert Entered.of(entered.word()) == entered
    assert entered.process == 12
    assert Path(*tmp_path.parts[:3]) in entered.shown
    assert Entered.with_own(12, Path("/tmp"), Path("/tmp/a/b"), Path("/tmp/a")).shown.count(Path("/tmp/a")) == 1
    assert not [path for path in entered.shown if path.name == ".."]


def test_a_sandbox_shows_what_its_test_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may lie below ``/tmp``, which is another one there; what only the application names is not shown."""
    shown: list[Entered | None] = []

    async def opened(_client: SandboxClient, _slot: Slot, _log: int, entered: Entered | None) -> None:
        shown.append(entered)

    monkeypatch.setattr(SandboxClient, "open", opened)
    monkeypatch.setattr(Reports, "listen", lambda *_: None)
    folder = Path("/tmp/dodo-a/repository/generated/test")
    one = plan(import_paths=("../../../../dodo-b",))
    (app,) = one.application.services
    guesses = {"LOG": "/tmp/dodo-log", "GUESS": "/tmp/dodo-guess:/tmp/\0"}
    app = replace(app, process=("/tmp/dodo-e/program", "/tmp/dodo-word"), environment=guesses)
    one = replace(one, application=replace(one.application, services=(app,)))
    monkeypatch.setenv("SSH_AUTH_SOCK", "/tmp/dodo-agent/socket")
    monkeypatch.setenv("LD_LIBRARY_PATH", f"/usr/lib{os.pathsep}/dev/shm/dodo-d/lib")
    for container in (0, 12):
        watched = WatchedServices(one, folder, Path("/tmp/dodo-c/report"))
        asyncio.run(ProcessSide(watched, Slot(130), "network").open(container))
        entered = shown.pop()
        assert entered is not None and entered.process == container
        names = {path.name for path in entered.shown}
        assert {"dodo-a", "dodo-b", "dodo-c", "dodo-d", "dodo-e"} <= names
        assert not names & {"dodo-log", "dodo-guess", "dodo-word", "dodo-agent"}
