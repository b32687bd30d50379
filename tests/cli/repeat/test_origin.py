"""What is noted of a run: its command without secrets, and the commits of its repositories."""

import shlex
import subprocess
from pathlib import Path

import pytest

from dodo_dsl.cli.main import parser
from dodo_dsl.cli.provenance import Origin, command_line, recording, repositories


def git(folder: Path, *words: str) -> str:
    settings = ("-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "init.defaultBranch=main")
    return subprocess.run(["git", *settings, *words], cwd=folder, check=True, capture_output=True, text=True).stdout


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    folder = tmp_path / "car"
    (folder / "tests").mkdir(parents=True)
    (folder / "compose.yml").write_text("services: {}\n")
    git(folder, "init", "-q")
    git(folder, "add", ".")
    git(folder, "commit", "-qm", "First")
    return folder


@pytest.mark.parametrize(
    ("words", "noted"),
    [
        ((), "dodo run"),
        (("sil-a[light=1]", "-j", "2", "--seed=7"), "dodo run 'sil-a[light=1]' --jobs 2 --seed 7"),
        (("--level", "sil", "--level", "dil", "--wall-timeout", "90"),
         "dodo run --level sil --level dil --wall-timeout 90"),
        (("--repeat", "3", "--retry-errors", "--fail-fast"), "dodo run --repeat 3 --retry-errors 1 --fail-fast"),
        (("--application", "a b.yml", "-q", "--report", "out"), "dodo run --application 'a b.yml'"),
    ],
)  # fmt: skip
def test_a_command_is_noted_that_does_the_same(words: tuple[str, ...], noted: str) -> None:
    assert command_line(parser().parse_args(["run", *words])) == noted
    assert command_line(parser().parse_args(shlex.split(noted)[1:])) == noted


def test_an_option_that_is_not_known_to_be_harmless_is_left_out() -> None:
    options = parser().parse_args(["run", "sil-a"])
    options.environment = ["TOKEN=s3cr3t"]
    assert command_line(options) == "dodo run sil-a"


def test_a_repository_is_known_by_its_commit(repository: Path) -> None:
    commit = git(repository, "rev-parse", "HEAD").strip()
    folders = {"application": repository, "tests": repository / "tests"}
    with recording(Origin("dodo run", folders)) as record:
        run = record()
    (found,) = run.repositories
    assert (found.what, found.commit, found.changed) == ("application and tests", commit, False)
    (repository / "new.yml").write_text("")
    assert [one.changed for one in repositories({"tests": repository})] == [True]


def test_a_folder_without_a_commit_is_no_repository(tmp_path: Path) -> None:
    git(tmp_path, "init", "-q")
    assert repositories({"application": tmp_path / "gone", "tests": tmp_path}) == ()


def test_without_git_nothing_is_known(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    assert repositories({"tests": repository}) == ()


def test_a_repository_starts_no_program_of_its_own(repository: Path) -> None:
    git(repository, "config", "core.fsmonitor", f"touch {repository / 'started'}; false")
    assert len(repositories({"tests": repository})) == 1
    assert not (repository / "started").exists()
