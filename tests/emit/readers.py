"""Programs that read compiled output: compose and check-jsonschema, and compiled folders as dictionaries."""

import functools
import shutil
import subprocess
import sys
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl.cli import main

ROOT = Path(__file__).parents[2]
PLUGIN = Path.home() / ".docker/cli-plugins/docker-compose"


_parser = functools.cache(main.parser)


def run(*words: str) -> tuple[int, str, str]:
    """The exit code and the two outputs of a ``dodo`` command in this process, with one parser for all."""
    stdout, stderr = StringIO(), StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(main, "parser", _parser)
        code = main.main(words, stdout, stderr)
    return code, stdout.getvalue(), stderr.getvalue()


def pipeline(text: str) -> dict[str, Any]:
    """A child pipeline as GitLab sees it: each job with what it extends, and no hidden one."""
    read = yaml.safe_load(text)

    def extended(value: Any) -> Any:
        is_job = isinstance(value, dict) and "extends" in value
        return {**extended(read[value["extends"]]), **value} if is_job else value

    return {key: extended(value) for key, value in read.items() if not key.startswith(".")}


def tree(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def first_instances(generated: Path) -> list[Path]:
    """The folders of compiled tests, with one instance of each matrix."""
    folders = sorted(path.parent for path in generated.glob("*/test.json"))
    return list({folder.name.partition("--")[0]: folder for folder in reversed(folders)}.values())


def check_schema(*words: str) -> None:
    program = Path(sys.executable).parent / "check-jsonschema"
    result = subprocess.run([program, *words], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


@functools.cache
def _compose() -> list[str]:
    if PLUGIN.is_file():
        return [str(PLUGIN)]
    probe = ["docker", "compose", "version"]
    if shutil.which("docker") and not subprocess.run(probe, capture_output=True, check=False).returncode:
        return ["docker", "compose"]
    return []


def compose() -> list[str]:
    """The command of Compose v2; skips the test without one."""
    return _compose() or pytest.skip("Compose v2 is not installed")
