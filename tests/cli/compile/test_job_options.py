"""``dodo compile --tags --image --run-options --images``."""

import argparse
import json
from pathlib import Path

import pytest

from dodo_dsl.cli.compile import _services as services
from dodo_dsl.cli.compile import _tags as tags
from tests.check import examples
from tests.emit.readers import pipeline, run


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("sil", ("sil",)),
        ("sil, large machine,sil", ("sil", "large machine")),
        (' ["sil", "a, b"]', ("sil", "a, b")),
        ("[]", ()),
        (" [] ", ()),
        ("", ()),
        ('[""]', ()),
    ],
)
def test_tags_are_words_or_a_list_as_gitlab_writes_it(text: str, found: tuple[str, ...]) -> None:
    assert tags(text) == found


@pytest.mark.parametrize("text", ["[sil]", '["sil"', "[1]", '[["sil"]]'])
def test_other_lists_are_refused(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="tag"):
        tags(text)


def test_services_are_a_list_of_what_gitlab_takes() -> None:
    dind = {"name": "docker:dind", "alias": "docker", "command": ["--tls=false"]}
    for found in ([], ["redis", "a: b"], [dind, "redis"]):
        assert services(f" {json.dumps(found)}") == tuple(found)
    assert services("") == ()


@pytest.mark.parametrize("text", ["redis", "[1]", '["a"', "[[]]", '[""]', '[{"alias": "a"}]', '[{:name=>"a"}]', "{}"])
def test_other_services_are_refused(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="is not a JSON list of names"):
        services(text)


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    examples.write(examples.SPEC, tmp_path)
    return tmp_path


@pytest.mark.usefixtures("repository")
def test_the_pipeline_has_them() -> None:
    wanted = ("--tags", ' ["docker"]', "--image", "dodo-runner", "--run-options", "--isolation host")
    assert run("compile", *wanted)[0] == 0
    made = pipeline(Path("generated/child.gitlab-ci.yml").read_text())
    assert (made["example"]["tags"], made["example"]["image"]) == (["docker"], "dodo-runner")
    assert made["variables"]["DODO_RUN_OPTIONS"] == "--isolation host"
    assert run("compile", "--check", *wanted)[0] == 0
    code, out, _ = run("compile", "--services", "docker:dind")
    assert code == 2, "neither a list nor a job that would run without it"
    code, out, _ = run("compile", "--check", "--tags", "")
    assert code == 1 and "-  tags: [docker]\n" in out


@pytest.mark.thorough
def test_images_that_were_built_reach_each_test(repository: Path) -> None:
    image = "DODO_IMAGE_STEERING=registry.example.org/steering@sha256:12"
    (repository / "images.env").write_text(f"{image}\n")
    for _ in range(2):
        assert run("compile", "--images", "images.env")[0] == 0
        lines = (repository / "generated/example/.env").read_text().splitlines()
        assert lines[-1] == image and lines.count(image) == 1
    made = pipeline((repository / "generated/child.gitlab-ci.yml").read_text())
    assert " --backend docker " in made["example"]["script"][1]
    (repository / "images.env").write_text("")
    assert run("compile", "--images", "images.env")[0] == 0
    assert "DODO_IMAGE" not in (repository / "generated/example/.env").read_text()
    assert run("compile", "--check")[0] == 0


@pytest.mark.parametrize("line", ["STEERING=x", "DODO_IMAGE_A=x; y", "DODO_IMAGE_A=", "PATH=x"])
def test_a_file_of_something_else_is_refused(repository: Path, line: str) -> None:
    (repository / "images.env").write_text(f"DODO_IMAGE_A=a:1\n{line}\n")
    code, _, err = run("compile", "--images", "images.env")
    assert code == 2 and "images.env:2: expected a line such as DODO_IMAGE_" in err
    assert not (repository / "generated").exists()
    code, _, err = run("compile", "--images", "none.env")
    assert code == 2 and "none.env" in err
    code, _, err = run("compile", "--images", "images.env", "--check")
    assert code == 2 and "--check" in err
