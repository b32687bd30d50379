"""``dodo rig`` without a rig; with one it is tested where rigs run."""

from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main
from dodo_dsl.cli.rig import _sentence
from dodo_dsl.run.rigs import access
from dodo_dsl.spec.deployment import load_deployment


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def rig(*words: str) -> tuple[int, str, str]:
    stdout, stderr = StringIO(), StringIO()
    return main(["rig", *words], stdout, stderr), stdout.getvalue(), stderr.getvalue()


def test_without_rigs_the_emulated_one_is_named() -> None:
    said = "dodo.yml has no rigs; every machine has 'emulated': dodo rig status emulated\n"
    assert rig("status") == (0, said, "")
    assert rig("status", "--json") == (0, "[]\n", "")


def test_an_unknown_rig_and_those_that_are_known(folder: Path) -> None:
    (folder / "dodo.yml").write_text("dodo: 1\nrigs: {desk: {kind: static, cid: 120, camera: {source: a.png}}}\n")
    assert rig("home", "dask") == (
        2,
        "",
        "dodo rig: unknown rig 'dask', expected one of emulated, emulated-circle, desk\n",
    )
    assert rig("home", "desk") == (2, "", "dodo rig: rig 'desk' has no serial port, so it cannot move\n")


def test_constants_of_the_rig_are_flags_of_the_gantry(folder: Path) -> None:
    axes = "x: {steps: 3.3 steps/mm, offset: 2990.5 steps}, yaw: {steps: 31.5 steps/rad}"
    (folder / "dodo.yml").write_text(f"dodo: 1\nrigs: {{desk: {{kind: dynamic, cid: 120, axes: {{{axes}}}}}}}\n")
    deployment, problems = load_deployment(folder / "dodo.yml")
    assert not problems
    flags = access.flags(deployment.rigs["desk"])
    assert flags == ["--steps-x=3300", "--steps-yaw=0.549778714378214", "--offset-x=2990.5"]


@pytest.mark.parametrize(
    ("about", "said"),
    [
        ("limits: {x: 2 m}", "dodo.yml:2:52: parameter 'limits.x' is 2 m, expected 0.01 to 1.9 m"),
        ("limits: {speed: 5 m/s}", "dodo.yml:2:56: parameter 'limits.speed' is 5 m/s, expected 0.01 to 1 m/s"),
        ("axes: {x: {steps: 5000 steps/m}}",
         "dodo.yml:2:58: parameter 'axes.x.steps' is 5000 steps/m, expected 2988 to 3652 steps/m"),
    ],
)  # fmt: skip
def test_a_limit_that_the_gantry_refuses_is_named_as_it_is_written(folder: Path, about: str, said: str) -> None:
    (folder / "dodo.yml").write_text(
        f"dodo: 1\nrigs: {{desk: {{kind: dynamic, cid: 120, {about}, serial: /dev/none}}}}\n"
    )
    assert rig("calibrate", "desk") == (2, "", f"dodo rig: {said}\n")
    assert rig("status", "desk") == (3, f"desk: {said}\n", "")


def test_a_result_in_words() -> None:
    result = {"rig": "desk", "quarantine": "", "says": "ready", "x": 0.1, "y": -0.25, "yaw": 90.0}
    assert _sentence(result) == "desk: ready, x = 0.100 m, y = -0.250 m, yaw = 90.0 degrees"
    assert _sentence({**result, "x": None}) == "desk: ready"
    assert _sentence({"rig": "desk", "quarantine": ""}) == "desk: not in quarantine"
    broken = {"rig": "desk", "quarantine": "belt", "error": "no answer"}
    assert _sentence(broken) == "desk: no answer; in quarantine: belt; 'dodo rig clear desk' ends it"
