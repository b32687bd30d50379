"""Tests whose rig is missing, or emulated and not built."""

import io
from pathlib import Path

import pytest

from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.main import parser
from dodo_dsl.cli.run_jobs import prepare
from tests.check import examples

DRIVER = """\
# docker-compose.yml
services:
  driver:
    image: driver
    command: --cid=111
    x-dodo: {out: [opendlv.proxy.GroundSteeringRequest, opendlv.proxy.PedalPositionRequest]}
    x-dodo-process: [python, driver.py]
# dodo.yml
registry: [tests, "dodo:"]
"""
ON_THE_RIG = ["hil-closed-oval", "hil-dynamic", "hil-open-straight"]
RIGLESS = "skipped shipped tests that need a rig, which dodo.yml does not have: "
SAID = f"skipped shipped tests on the emulated rig, which is not built: {', '.join(ON_THE_RIG)} (see dodo doctor)\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    examples.write(DRIVER, tmp_path)
    (tmp_path / "driver.py").touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DODO_FIRMWARE", str(tmp_path / "firmware"))
    return tmp_path


def selected(folder: Path, *words: str) -> tuple[list[str], str]:
    """The tests that run, and what is said about others."""
    said = io.StringIO()
    options = parser().parse_args(["run", "--report", str(folder / "report"), *words])
    jobs, _ = prepare(options, folder / "out", said)
    return sorted(job.test for job in jobs), said.getvalue()


@pytest.mark.thorough
def test_those_that_nobody_named_are_left_out(folder: Path) -> None:
    names, said = selected(folder, "--level", "sil", "--level", "hil", "--emulate")
    assert SAID in said and "sil-closed-straight" in names and not set(ON_THE_RIG) & set(names)
    names, said = selected(folder, "--level", "sil", "--level", "hil")
    assert f"{RIGLESS}{', '.join(ON_THE_RIG)} (--emulate" in said and "sil-closed-straight" in names
    assert SAID not in said and not set(ON_THE_RIG) & set(names)
    with pytest.raises(UsageError, match="no tests to run"):
        selected(folder, "hil-*")


@pytest.mark.thorough
def test_they_run_where_they_are_named_or_can_run(folder: Path) -> None:
    assert selected(folder, "hil-dynamic") == (["hil-dynamic"], "")
    assert selected(folder, "hil-*", "--backend", "docker")[0] == ON_THE_RIG, "the rig is in an image"
    (folder / "firmware").mkdir()
    for name in ("rig-emulator", "gantry.elf"):
        (folder / "firmware" / name).touch()
    names, said = selected(folder, "hil-*")
    assert names == ON_THE_RIG and "emulated rig" not in said
