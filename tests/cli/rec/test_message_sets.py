"""The messages of a repository's dodo.yml, and those of the command line."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from dodo_dsl.opendlv.envelope import Envelope
from tests.rec.conftest import BEGIN, dodo_rec

CONE = "message team.Cone [id = 8000] { uint32 colour [id = 1]; }\n"
GATE = "message team.Gate [id = 8001] { uint32 number [id = 1]; }\n"


@pytest.fixture
def rec(tmp_path: Path, record: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> Path:
    """A recording of both messages; the working folder lies deep in a repository whose dodo.yml names the first."""
    (tmp_path / "cone.odvd").write_text(CONE)
    (tmp_path / "gate.odvd").write_text(GATE)
    (tmp_path / "dodo.yml").write_text("dodo: 1\nmessages: [cone.odvd]\n")
    (tmp_path / "a" / "b").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "a" / "b")
    return record([Envelope(id_, b"\x08\x07", 1, 2, BEGIN + id_, 3) for id_ in (8000, 8001)])


def names(rec: Path, *words: str) -> tuple[list[str | None], str]:
    code, stdout, stderr = dodo_rec("info", "--json", rec, *words)
    assert code == 0
    return [message["name"] for message in json.loads(stdout)["messages"]], stderr


def test_info_names_messages_of_the_repository(rec: Path) -> None:
    assert names(rec) == (["team.Cone", None], "")


def test_files_of_the_command_line_are_added(rec: Path) -> None:
    assert names(rec, "--messages=../../gate.odvd") == (["team.Cone", "team.Gate"], "")
    assert names(rec, "--messages=../../cone.odvd", "--messages=0.9") == (["team.Cone", None], "")


def test_tables_of_the_repository_s_messages(rec: Path, tmp_path: Path) -> None:
    code, stdout, stderr = dodo_rec("export", rec, "--csv", "-o", tmp_path / "out", "--message=team.Cone")
    assert (code, stdout, stderr) == (0, f"{tmp_path / 'out'}: 1 tables with 1 rows\n", "")
    head, row = (tmp_path / "out" / "team.Cone-3.csv").read_text().splitlines()
    assert head.endswith(";colour;") and row.endswith(";7;")


def test_without_a_repository_nothing_is_known_of_them(rec: Path, tmp_path: Path) -> None:
    (tmp_path / "dodo.yml").unlink()
    assert names(rec) == ([None, None], "")


@pytest.mark.parametrize(
    ("deployment", "odvd", "said"),
    [
        ("dodo: 1\nmessages: [none.odvd]\n", CONE, "dodo.yml:2:12: there is no file 'none.odvd'; the messages of "),
        ("dodo: 1\nmesages: [cone.odvd]\n", CONE, "dodo.yml:2:1: "),
        ("dodo: 1\nmessages: [cone.odvd]\n", "message team.Cone [", "cone.odvd:1:"),
    ],
)
def test_a_deployment_that_cannot_be_used_is_told_and_left_out(
    rec: Path, tmp_path: Path, deployment: str, odvd: str, said: str
) -> None:
    (tmp_path / "dodo.yml").write_text(deployment)
    (tmp_path / "cone.odvd").write_text(odvd)
    found, stderr = names(rec, "--messages=../../gate.odvd")
    assert found == [None, "team.Gate"]
    assert stderr.startswith(f"dodo rec: {tmp_path}/{said}") and stderr.endswith("dodo.yml are skipped\n")
    assert len(stderr.splitlines()) == 1


@pytest.mark.thorough
def test_a_file_that_disagrees_with_the_repository(rec: Path, tmp_path: Path) -> None:
    (tmp_path / "other.odvd").write_text(CONE.replace("uint32 colour", "float size"))
    found, stderr = names(rec, "--messages=../../other.odvd")
    assert found == ["team.Cone", None]
    assert stderr.startswith("dodo rec: ") and stderr.endswith(f"; the messages of {tmp_path}/dodo.yml are skipped\n")


def test_a_broken_file_of_the_command_line_is_an_error(rec: Path, tmp_path: Path) -> None:
    (tmp_path / "broken.odvd").write_text("message")
    code, stdout, stderr = dodo_rec("info", rec, f"--messages={tmp_path / 'broken.odvd'}")
    assert (code, stdout) == (2, "") and stderr.startswith(f"dodo rec: {tmp_path / 'broken.odvd'}:1:")
