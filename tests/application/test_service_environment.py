"""The environment of services: images, files and CID variables."""

from pathlib import Path

from dodo_dsl.application.model import env_files, file_variables, image_variable
from tests.source.nodes import mapping


def test_the_variable_of_an_image() -> None:
    assert image_variable("my-eyes.v2") == "DODO_IMAGE_MY_EYES_V2"


def test_files() -> None:
    found = list(env_files(mapping("env_file: [a.env, {path: b.env, required: false}, {path: c.env}, 3]")))
    assert [(file.path, file.required) for file in found] == [("a.env", True), ("b.env", False), ("c.env", True)]
    assert [file.path for file in env_files(mapping("env_file: a.env"))] == ["a.env"]
    assert list(env_files(mapping("image: x"))) == []


def test_variables_of_files(tmp_path: Path) -> None:
    (tmp_path / "a.env").write_text("OD4SESSION_CID=111\nOTHER=1\n")
    (tmp_path / "b.env").write_text("CID=112\n")
    files = env_files(mapping("env_file: [a.env, b.env, none.env, ~/c.env, '$D.env', /e.env]"))
    assert file_variables(files, tmp_path) == {"OD4SESSION_CID": "111", "OTHER": "1", "CID": "112"}
