"""Files of the application that a compiled test reads where they are."""

from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.application.access.model import Access
from dodo_dsl.plan.model import Application, ApplicationService
from dodo_dsl.run.application_files import application_paths, hidden_paths, secrets_of

FOLDER = Path("generated/t")


def application(*env_files: str, roots: tuple[str, ...] = ()) -> Application:
    service = ApplicationService("driver", env_files=env_files)
    secrets = {
        "LD_PRELOAD": "../../team/.env",
        "API_KEY": "../../team/.env",
        "GONE_KEY": "../../team/.env",
        "OLD_KEY": "../../none/.env",
    }
    access = Access(roots=roots, paths=("/etc/ros",))
    return Application("../../team", (service,), secrets=secrets, access=access)


def test_paths(tmp_path: Path) -> None:
    (tmp_path / "team").mkdir()
    paths = application_paths(application(roots=("../../maps",)), tmp_path / FOLDER)
    assert (paths.folder, paths.roots) == (tmp_path / "team", (tmp_path / "team", tmp_path / "maps"))
    assert paths.is_own("/etc/ros/x")


def test_secrets_are_read_where_they_are(tmp_path: Path) -> None:
    (tmp_path / FOLDER).mkdir(parents=True)
    (tmp_path / "team").mkdir()
    (tmp_path / "team" / ".env").write_text("API_KEY=a-${HOST}\nSPEED=3\nLD_PRELOAD=evil.so\n")
    assert secrets_of(application(), tmp_path / FOLDER, {"HOST": "here"}) == {"API_KEY": "a-here"}


@pytest.mark.parametrize("report", ["dodo-report/t", "dodo-report/.next-1a2b/t"])
def test_the_whole_report_is_hidden_also_while_the_next_one_is_written(tmp_path: Path, report: str) -> None:
    team = tmp_path / "team"
    (team / report).mkdir(parents=True)
    made = Application(".", (ApplicationService("driver"),))
    assert hidden_paths(made, team, team / report) == [team / "dodo-report"]


def test_own_state_and_caches_in_the_repository_are_hidden(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    team = tmp_path / "team"
    for variable, name in (("XDG_STATE_HOME", ".state"), ("XDG_CACHE_HOME", ".cache")):
        (team / name / "dodo").mkdir(parents=True)
        monkeypatch.setenv(variable, str(team / name))
    made = Application(".", (ApplicationService("driver"),))
    assert hidden_paths(made, team, tmp_path / "report") == [team / ".state" / "dodo", team / ".cache" / "dodo"]


def test_files_that_tests_share_are_hidden_with_the_tests(tmp_path: Path) -> None:
    """Also where the tests are compiled into the application's own folder."""
    for name in ("dil-a", "_files", "out/dil-a", "out/_files"):
        (tmp_path / name).mkdir(parents=True)
    made = Application(folder="..", services=())
    elsewhere = tmp_path.parent / "report"
    assert hidden_paths(made, tmp_path / "dil-a", elsewhere) == [tmp_path / "dil-a", tmp_path / "_files"]
    assert hidden_paths(replace(made, folder="../.."), tmp_path / "out/dil-a", elsewhere) == [tmp_path / "out"]
