"""What a sandbox enters, as a word of its command line."""

import asyncio
import sys
from pathlib import Path

import pytest

from dodo_dsl.run.process.backend import ProcessBackend
from dodo_dsl.run.process.entered import Entered
from dodo_dsl.run.process.sandbox_client import SandboxClient
from dodo_dsl.run.process.slot import Slot
from tests.run.scripted import plan


def test_it_is_read_as_it_was_written(tmp_path: Path) -> None:
    entered = Entered.with_own(12, tmp_path / "a b")
    assert Entered.among(["3", "network", "--forks", entered.word()]) == entered
    assert entered.process == 12
    assert entered.shown[0] == tmp_path / "a b"
    assert Path(sys.prefix).resolve() in entered.shown
    assert Entered.among(["3", "network", "--forks"]) is None


def test_a_sandbox_in_a_container_shows_own_services(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their folder may lie below ``/tmp``, which is the container's there."""
    shown: list[Entered | None] = []

    async def opened(_client: SandboxClient, _slot: Slot, _folder: Path, entered: Entered | None) -> None:
        shown.append(entered)

    monkeypatch.setattr(SandboxClient, "open", opened)
    folder = tmp_path / "repository/generated/test"
    backend = ProcessBackend(plan(import_paths=("../..",)), folder, tmp_path / "report", "network", Slot(130))
    asyncio.run(backend.open(container=12))
    (entered,) = shown
    assert entered is not None and entered.shown[:3] == (folder, tmp_path / "report", tmp_path / "repository")
