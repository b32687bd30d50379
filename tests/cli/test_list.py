"""``dodo list`` shows what there is, whatever is wrong with some of it."""

from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main


def dodo(*words: str) -> tuple[int, str, str]:
    stdout, stderr = StringIO(), StringIO()
    code = main(words, stdout, stderr)
    return code, stdout.getvalue(), stderr.getvalue()


@pytest.mark.thorough
def test_a_broken_test_is_one_line_beside_the_list(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert dodo("new", "--deployment")[0] == dodo("new", "mine")[0] == dodo("new", "other")[0] == 0
    spec = tmp_path / "tests/mine/mine.dodo.yml"
    spec.write_text(spec.read_text().replace("9.5 cm", "9.5").replace("level: sil", "level: sail"))
    code, out, err = dodo("list")
    assert (code, [line.split()[:2] for line in out.splitlines()]) == (2, [["sil", "other"], ["?", "mine"]])
    assert err == "problems in tests/mine/mine.dodo.yml; dodo compile --check shows them\n"


@pytest.mark.thorough
def test_shipped_tests_that_need_more_are_no_problem(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    dodo("new", "--deployment")
    deployment = tmp_path / "dodo.yml"
    deployment.write_text(deployment.read_text().replace("[tests]", '["dodo:"]'))
    code, out, err = dodo("list")
    assert code == 0
    assert "\nsil  sil-perception " in out
    levels = [line.split()[0] for line in out.splitlines()]
    assert levels == sorted(levels, key=["sil", "dil", "hil"].index)
    assert err.startswith(
        "skipped shipped tests that do not fit what the application sends and takes: dil-static-rig, hil-camera,"
    )


@pytest.mark.thorough
def test_a_parameter_that_another_service_gives_is_not_just_required() -> None:
    code, out, _ = dodo("list", "--services", "collision")
    assert code == 0
    assert "  fovy: number, default 48.8 deg; 1 to 170 deg\n" in dodo("list", "--services", "virtual-camera")[1]
    assert "  map-path: path, required unless another service of the test provides it\n" in out
    assert "  message: message, required\n" in dodo("list", "--services", "continuous-signal")[1]


@pytest.mark.thorough
def test_only_the_tests_that_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dodo.yml").write_text('dodo: 1\nregistry: ["dodo:"]\n')
    code, out, err = dodo("list", "sil-perception[clutter=0,light=1]", "sil-closed-*")
    names = [line.split()[1] for line in out.splitlines()]
    assert (code, err, names[-1]) == (0, "", "sil-perception[light=1,clutter=0]")
    assert all(name.startswith("sil-closed-") for name in names[:-1])
    assert dodo("list", "sil-perception[light=7]")[0] == 2
    assert dodo("list", "x", "--services")[0] == 2


def test_a_matrix_is_one_row_until_it_is_unfolded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dodo.yml").write_text('dodo: 1\nregistry: ["dodo:"]\n')
    words = ("list", "sil-perception", "sil-open-straight")
    whole = "6 instances (light, clutter): Find the cones along a track in bright and in dim light"
    (row,) = (line for line in dodo(*words)[1].splitlines() if "perception" in line)
    assert row.startswith(f"sil  sil-perception     perception  {whole}")
    assert dodo(*words, "-v")[1].count("\nsil  sil-perception[light=") == 6
