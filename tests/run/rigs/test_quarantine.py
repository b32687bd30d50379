"""Rigs in quarantine, kept in files."""

from pathlib import Path

import pytest

from dodo_dsl.run.rigs.leases import all_quarantined, clear_quarantine, quarantine, quarantined
from dodo_dsl.run.rigs.problems import RigProblem


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DODO_RIGS", str(tmp_path / "state"))
    return tmp_path / "state"


def test_it_lasts_until_it_is_cleared() -> None:
    assert (quarantined("kiwi"), all_quarantined(), clear_quarantine("kiwi")) == ("", {}, False)
    quarantine("kiwi", "it has lost steps")
    quarantine("other", "its camera is dark")
    assert all_quarantined() == {"kiwi": "it has lost steps", "other": "its camera is dark"}
    assert (clear_quarantine("kiwi"), quarantined("kiwi"), clear_quarantine("kiwi")) == (True, "", False)
    assert list(all_quarantined()) == ["other"]


@pytest.mark.parametrize("text", ["", "[]", "{}", "3", '{"reason"'])
def test_a_damaged_file_is_a_quarantine(state: Path, text: str) -> None:
    state.mkdir()
    (state / "kiwi.json").write_text(text)
    assert quarantined("kiwi") == "its quarantine file cannot be read"
    assert clear_quarantine("kiwi")


@pytest.mark.parametrize("name", ["", "../kiwi", "Kiwi", "a.b", "-a", "a b"])
def test_a_strange_name_reaches_no_file(state: Path, name: str) -> None:
    for call in (quarantined, clear_quarantine):
        with pytest.raises(RigProblem, match="is not a rig's name, expected lower-case letters, digits and hyphens"):
            call(name)
    with pytest.raises(RigProblem):
        quarantine(name, "x")
    assert not state.exists()


def test_other_files_are_no_rigs(state: Path) -> None:
    state.mkdir()
    for name in ("kiwi.txt", "Upper.json", "kiwi.4711.part"):
        (state / name).touch()
    assert all_quarantined() == {}


def test_a_quarantine_that_cannot_be_written_is_an_error_with_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("DODO_RIGS", str(tmp_path / "file" / "rigs"))
    with pytest.raises(RigProblem, match=r"cannot be written to '.*kiwi\.json': Not a directory \(it has lost steps\)"):
        quarantine("kiwi", "it has lost steps")
