"""What a test says of a docker command that cannot compose it."""

import asyncio
import os
from pathlib import Path

import pytest

from dodo_dsl.run.docker.compose import Compose
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
def test_a_command_without_compose_is_not_the_tests_fault(
    stderr: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "docker"
    program.write_text(f"#!/bin/sh\ncat >&2 <<'END'\n{stderr}\nEND\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    with pytest.raises(BackendError, match=said):
        asyncio.run(Compose(plan(), tmp_path, tmp_path, "project", print).read())
