"""What ``dodo doctor`` finds on machines that lack something."""

from pathlib import Path

import pytest

from dodo_dsl import advice
from dodo_dsl.run import capabilities
from dodo_dsl.run.capabilities import rigs
from dodo_dsl.run.rigs.leases import quarantine
from services.gantry import emulator
from tests.run.docker.engine_stub import engine_stub


def test_an_engine_on_a_port_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DOCKER_TLS_VERIFY", "DOCKER_CERT_PATH"):
        monkeypatch.delenv(name, raising=False)
    with engine_stub() as host:
        monkeypatch.setenv("DOCKER_HOST", host)
        (engine,) = capabilities.docker_engine()
    assert (engine.state, engine.text) == ("ok", f"version 99.0, API 1.41 at {host}")


def test_whether_the_emulated_rig_is_built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Looked for where the gantry looks."""
    assert (capabilities.FIRMWARE, capabilities.EMULATOR_PLACES) == (emulator.FOLDER, emulator.PLACES)
    monkeypatch.setenv(capabilities.FIRMWARE, str(tmp_path))
    (found,) = capabilities.emulated_rig()
    assert (found.state, found.text) == ("warning", f"is not built: it is not in {tmp_path}; hil tests need it")
    assert found.advice == advice.FIRMWARE
    for name in ("rig-emulator", "gantry.elf"):
        (tmp_path / name).write_bytes(b"")
    (found,) = capabilities.emulated_rig()
    assert (found.state, found.text) == ("ok", f"is built, in {tmp_path}")


def test_a_user_without_a_home_folder_gets_advice(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("HOME", "XDG_STATE_HOME", "DODO_RIGS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("os.getuid", lambda: 3_999_999_999)
    (found,) = rigs()
    told = "user 3999999999 has no home folder: set DODO_RIGS or XDG_STATE_HOME"
    assert (found.state, found.text) == ("warning", f"quarantines cannot be kept: {told}")


def test_rigs_in_quarantine_are_problems(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DODO_RIGS", str(tmp_path))
    assert list(rigs()) == []
    quarantine("kiwi", "it has lost steps")
    (found,) = rigs()
    assert (found.name, found.state, found.text) == ("rig kiwi", "problem", "in quarantine: it has lost steps")
    assert found.advice == "repair it, then dodo rig clear kiwi"
