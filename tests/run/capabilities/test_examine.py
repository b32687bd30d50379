"""What ``dodo doctor`` says of a machine on which even looking fails."""

from pathlib import Path

import pytest

from dodo_dsl.run import capabilities
from services.gantry import emulator


def test_what_cannot_be_looked_at_is_a_finding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a folder that is gone; what else there is to look at is looked at."""
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    found = {finding.name: finding for finding in capabilities.examine()}
    assert (found["disk"].state, found["disk"].text[:22]) == ("problem", "cannot be looked at: [")
    assert {"multicast", "shared memory", "docker engine", "left behind"} <= set(found)


def test_whether_the_emulated_rig_is_built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Looked for where the gantry looks."""
    assert (capabilities.FIRMWARE, capabilities.EMULATOR_PLACES) == (emulator.FOLDER, emulator.PLACES)
    monkeypatch.setenv(capabilities.FIRMWARE, str(tmp_path))
    found = {finding.name: finding for finding in capabilities.examine()}["emulated rig"]
    assert (found.state, found.text) == ("warning", f"is not built: it is not in {tmp_path}")
    assert "make firmware in DoDo's checkout, or set DODO_FIRMWARE to its folder" in found.advice
    for name in ("rig-emulator", "gantry.elf"):
        (tmp_path / name).write_bytes(b"")
    found = {finding.name: finding for finding in capabilities.examine()}["emulated rig"]
    assert (found.state, found.text) == ("ok", f"is built, in {tmp_path}")
