"""Files of the application that a compiled test reads where they are."""

from pathlib import Path

import pytest

from dodo_dsl.application.access.model import Access
from dodo_dsl.application.interpolation import EnvironmentProblem
from dodo_dsl.plan.model import Application, ApplicationService
from dodo_dsl.run.application_files import application_paths, env_file_findings, secrets_of

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


def test_environment_files_of_the_host(tmp_path: Path) -> None:
    (tmp_path / "team").mkdir()
    (tmp_path / "team" / ".env").write_text("CAR=kiwi\n")
    made = application("car.env", "${CAR}.env", "${X}", "/etc/passwd")
    paths = application_paths(made, tmp_path / FOLDER)
    assert [f.steps[-1] for f in env_file_findings(made, paths, {"X": "/etc/shadow"})] == [2, 3]


def test_a_variable_without_a_value(tmp_path: Path) -> None:
    made = application("${NOWHERE:?name it}")
    with pytest.raises(EnvironmentProblem, match="NOWHERE"):
        list(env_file_findings(made, application_paths(made, tmp_path), {}))
