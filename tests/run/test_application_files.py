"""Files of the application that a compiled test reads where they are."""

from pathlib import Path

import pytest

from dodo_dsl.plan.model import Application
from dodo_dsl.run.application_files import variables_of

FOLDER = Path("generated/t")


def application() -> Application:
    secrets = {
        "LD_PRELOAD": "../../team/.env",
        "API_KEY": "../../team/.env",
        "GONE_KEY": "../../team/.env",
        "OLD_KEY": "../../none/.env",
    }
    return Application("../../team", (), secrets=secrets)


def test_secrets_are_read_where_they_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No variable of them steers the engine's client, and DoDo's environment has none but what is passed."""
    monkeypatch.setenv("HOME", "/here")
    monkeypatch.setenv("API_TOKEN", "of the host")
    (tmp_path / FOLDER).mkdir(parents=True)
    (tmp_path / "team").mkdir()
    (tmp_path / "team" / ".env").write_text("API_KEY=a-${HOME}\nSPEED=3\nLD_PRELOAD=evil.so\n")
    found = variables_of(application(), tmp_path / FOLDER)
    assert found.keys() & {"API_KEY", "SPEED", "LD_PRELOAD", "API_TOKEN", "OLD_KEY"} == {"API_KEY"}
    assert found["API_KEY"] == "a-/here"
