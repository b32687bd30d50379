"""What an application never sees."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from dodo_dsl import package_data
from dodo_dsl.plan.model import Application
from dodo_dsl.run import hidden_paths as module
from dodo_dsl.run.hidden_paths import hidden_paths, of_repository, own_data


def made(folder: Path, *names: str) -> list[Path]:
    for name in names:
        (folder / name).mkdir(parents=True)
    return [folder / name for name in names]


def test_what_the_plan_names_and_outputs_and_history(tmp_path: Path) -> None:
    """As far as they are there, also those of an application in a folder of the repository."""
    made(tmp_path, "team/app", "team/maps")
    hidden = made(tmp_path / "team", "tests", "out/t", "report/t", ".git")
    application = Application("../../app", (), hidden=("../tests", "gone"))
    expected = [hidden[0], hidden[1].parent, hidden[2].parent, hidden[3]]
    assert hidden_paths(application, *hidden[1:3]) == expected


@pytest.mark.parametrize("report", ["dodo-report/t", "dodo-report/.next-1a2b/t"])
def test_the_whole_report_is_hidden_also_while_the_next_one_is_written(tmp_path: Path, report: str) -> None:
    test, path = made(tmp_path, "t", report)
    assert hidden_paths(Application("..", ()), test, path) == [test, tmp_path / "dodo-report"]


def test_own_state_and_caches_in_the_repository_are_hidden(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hidden = made(tmp_path, ".state/dodo", ".cache/dodo")
    for variable, path in zip(("XDG_STATE_HOME", "XDG_CACHE_HOME"), hidden, strict=True):
        monkeypatch.setenv(variable, str(path.parent))
    assert of_repository([tmp_path]) == hidden


def test_earlier_output_in_its_default_places_is_hidden_and_an_own_folder_of_that_name_is_not(tmp_path: Path) -> None:
    report, generated = made(tmp_path, "dodo-report", "generated")
    assert of_repository([tmp_path]) == [report]
    (generated / "child.gitlab-ci.yml").touch()
    assert of_repository([tmp_path]) == [report, generated]


@pytest.fixture
def python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of a Python that runs DoDo; what others have is not looked for."""
    prefix = tmp_path / "venv"
    monkeypatch.setattr(module, "INTERPRETER", (str(prefix),))
    monkeypatch.setattr(sys, "path", [])
    own_data.cache_clear()
    yield prefix
    own_data.cache_clear()


@pytest.mark.parametrize("layout", ["wheel", "editable", "checkout", "image"])
def test_tests_of_dodos_own_installation_are_hidden(
    tmp_path: Path, python: Path, monkeypatch: pytest.MonkeyPatch, layout: str
) -> None:
    data = python / "lib" / "python3.11" / "site-packages" / "dodo_dsl" / "_data"
    checkout = tmp_path / "dodo"
    for folder in (checkout / "dodo_dsl", checkout / "tests_registry", data / "tests_registry"):
        folder.mkdir(parents=True)
    hidden = {"wheel": data, "editable": data, "checkout": checkout / "tests_registry", "image": checkout}[layout]
    monkeypatch.setattr(package_data, "root", lambda: data if layout == "wheel" else checkout)
    assert hidden in own_data()
    assert hidden in of_repository([tmp_path])
