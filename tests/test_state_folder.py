"""Where a user's state is kept, also for a user without a home folder."""

from pathlib import Path

import pytest

from dodo_dsl.state_folder import NoStateFolder, state_path

NOBODY = 3_999_999_999
"""A user without an entry in the password database, as in a container that runs with ``--user``."""


@pytest.fixture(autouse=True)
def nothing_set(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("HOME", "XDG_STATE_HOME", "DODO_RIGS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("os.getuid", lambda: NOBODY)


@pytest.mark.parametrize(
    ("variables", "expected"),
    [
        ({"HOME": "/home/a"}, "/home/a/.local/state/dodo/rigs"),
        ({"HOME": "/home/a", "XDG_STATE_HOME": "/var/a"}, "/var/a/dodo/rigs"),
        ({"HOME": "/home/a", "XDG_STATE_HOME": "~/state"}, "/home/a/state/dodo/rigs"),
        ({"XDG_STATE_HOME": "/var/a"}, "/var/a/dodo/rigs"),
        ({"DODO_RIGS": "/tmp/mine"}, "/tmp/mine"),
        ({"DODO_RIGS": "", "HOME": "/home/a", "XDG_STATE_HOME": ""}, "/home/a/.local/state/dodo/rigs"),
    ],
    ids=str,
)
def test_variables_decide(variables: dict[str, str], expected: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert state_path("DODO_RIGS", "rigs") == Path(expected)


@pytest.mark.parametrize("empty", [{}, {"HOME": ""}, {"XDG_STATE_HOME": "~/state"}], ids=str)
def test_without_a_home_folder_the_error_says_what_to_set(
    empty: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in empty.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(NoStateFolder) as caught:
        state_path("DODO_RIGS", "rigs")
    assert str(caught.value) == f"user {NOBODY} has no home folder: set DODO_RIGS or XDG_STATE_HOME"
