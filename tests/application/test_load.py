"""Several files, and what they extend and include, in one document."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl.application.compose_files import ComposeFiles
from dodo_dsl.application.load import load
from dodo_dsl.application.model import plain
from dodo_dsl.application.read import read_application
from tests.application.composed import config

GOOD = Path(__file__).parent / "good"


def loaded(folder: Path, files: dict[str, str]) -> tuple[Any, list[str]]:
    """The services of the first file, and the messages about all of them."""
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    read = ComposeFiles()
    document = load(read, [folder / next(iter(files))])
    return document and plain(document)["services"], [problem.message for problem in read.problems]


def test_an_included_file_has_paths_of_its_own(tmp_path: Path) -> None:
    files = {
        "a.yml": "include: [sub/b.yml]\nservices: {a: {build: .}}\n",
        "sub/b.yml": "services: {b: {build: .}}\n",
    }
    assert loaded(tmp_path, files) == ({"b": {"build": "./sub"}, "a": {"build": "."}}, [])


def test_an_included_file_with_another_folder(tmp_path: Path) -> None:
    files = {
        "a.yml": "include: [{path: sub/b.yml, project_directory: other}]\nservices: {}\n",
        "sub/b.yml": "services: {b: {build: .}}\n",
    }
    assert loaded(tmp_path, files) == ({"b": {"build": "./other"}}, [])


@pytest.mark.parametrize(
    ("include", "message"),
    [
        ("[3]", "'include' does not name a file"),
        ("[none.yml]", "there is no file 'none.yml'"),
        ("[a.yml]", "'a.yml' includes itself, directly or through other files"),
        ("[b.yml]", "the included 'b.yml' also has a service 'a'"),
        ("[/etc/hosts]", "'/etc/hosts' may differ between machines, expected a relative path"),
    ],
)
def test_includes_that_are_refused(include: str, message: str, tmp_path: Path) -> None:
    files = {"a.yml": f"include: {include}\nservices: {{a: {{image: x}}}}\n", "b.yml": "services: {a: {image: y}}\n"}
    assert loaded(tmp_path, files)[1] == [message]


def test_variables_of_several_folders(tmp_path: Path) -> None:
    (tmp_path / ".env").write_text("A=1\nB=2\n")
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub/.env").write_text("B=3\nC=4\n")
    files = {"a.yml": "include: [sub/b.yml]\nservices: {}\n", "sub/b.yml": "services: {b: {image: x}}\n"}
    assert loaded(tmp_path, files)[1] == ["variable 'B' has another value in '.env' than in an earlier file"]


@pytest.mark.slow
@pytest.mark.parametrize("style", ["several", "extends", "include", "anchors"])
def test_files_are_merged_as_compose_merges_them(style: str, tmp_path: Path) -> None:
    """Everything that DoDo does not change is for compose the same in the merged file as in the many."""
    files = sorted(p for p in (GOOD / style).iterdir() if p.suffix == ".yml")[::-1]
    found, problems = read_application(files)
    assert found is not None, problems
    services = {name: plain(service.node) for name, service in found.services.items()}
    document = {"services": services, **{key: plain(node) for key, node in found.rest.items()}}
    (GOOD / style / ".merged").write_text(yaml.safe_dump(document))
    try:
        many = config(GOOD / style, *(word for file in files for word in ("-f", file.name)))
        one = config(GOOD / style, "-f", ".merged")
    finally:
        (GOOD / style / ".merged").unlink()
    for service in (*many.values(), *one.values()):
        service.pop("networks", None)
        if style == "include":  # a tag from the included folder's .env, which is not the merged file's
            service.pop("image", None)
    assert one == many
