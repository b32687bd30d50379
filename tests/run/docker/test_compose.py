"""What a test says of a docker command that cannot compose it."""

import asyncio
import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.plan.model import ApplicationService
from dodo_dsl.run.docker.compose import Compose
from dodo_dsl.run.docker.pulls import PullError, Pulls
from dodo_dsl.run.protocol import BackendError
from tests.run.scripted import plan


@pytest.mark.parametrize(
    ("stderr", "said"),
    [
        ("docker: unknown command: docker compose\n\nRun 'docker --help' for more information", "has no 'compose'"),
        ("unknown flag: --format\nSee 'docker --help'.", "has no 'compose'"),
        ("services.app.image must be a string", "rejects the compiled test: services.app.image must be a string"),
    ],
)
@pytest.mark.thorough
def test_a_command_without_compose_is_not_the_tests_fault(
    stderr: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "docker"
    program.write_text(f"#!/bin/sh\ncat >&2 <<'END'\n{stderr}\nEND\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    with pytest.raises(BackendError, match=said):
        asyncio.run(Compose(plan(), tmp_path, tmp_path, "project", print).read())


def test_compose_is_not_blamed_where_it_answers_by_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "docker"
    program.write_text('#!/bin/sh\ntest "$2" = version || { echo "odd. See \'docker --help\'." >&2; exit 1; }\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    with pytest.raises(BackendError, match="rejects the compiled test: odd"):
        asyncio.run(Compose(plan(), tmp_path, tmp_path, "project", print).read())
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    with pytest.raises(BackendError, match="there is no program 'docker'"):
        asyncio.run(Compose(plan(), tmp_path, tmp_path, "project", print).read())


@pytest.mark.parametrize(
    ("process", "image", "said"),
    [
        (None, "team/a", "; with 'x-dodo-process: [python, main.py]' 'a' starts as a process"),
        (("python", "a.py"), "team/a", ""),
        (None, "dodo/clock", ""),
    ],
)
def test_an_image_that_cannot_be_pulled(
    process: tuple[str, ...] | None, image: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def failing(*_: object) -> list[str]:
        raise PullError(image, "not found")

    monkeypatch.setattr(Pulls, "provide", failing)
    made = plan()
    made = replace(made, application=replace(made.application, services=(ApplicationService("a", process),)))
    test = Compose(made, tmp_path, tmp_path, "project", print)
    test.services = {"a": {"image": "team/a"}, "dodo-clock": {"image": "dodo/clock"}}
    with pytest.raises(BackendError) as raised:
        asyncio.run(test.provide_images(Pulls(None)))
    assert str(raised.value) == f"image {image} cannot be pulled: not found{said}"


@pytest.mark.parametrize("key", ["configs", "secrets"])
def test_files_of_the_report_are_no_configs(key: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A compiled test may be run with a report anywhere."""
    (tmp_path / "my-report" / "a").mkdir(parents=True)
    folder = tmp_path / "out" / "a"
    folder.mkdir(parents=True)
    for report, refused in (("my-report", True), ("data", False)):
        config = {"services": {}, key: {"c": {"file": f"{tmp_path}/{report}/results.json"}}}
        program = tmp_path / "docker"
        program.write_text(f"#!/bin/sh\necho '{json.dumps(config)}'\n")
        program.chmod(0o755)
        monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
        made = replace(plan(), application=replace(plan().application, folder="../.."))
        test = Compose(made, folder, tmp_path / "my-report" / "a", "project", print)
        if not refused:
            asyncio.run(test.read())
            continue
        with pytest.raises(BackendError, match=r"my-report/results\.json' lies where tests, their output or \.git are"):
            asyncio.run(test.read())
