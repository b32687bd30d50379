"""What compose makes of compose files."""

import json
import subprocess
from pathlib import Path
from typing import Any

from dodo_dsl import source
from tests.emit.readers import compose


def config(folder: Path, *words: str) -> Any:
    """The services that ``docker compose config`` shows."""
    command = [*compose(), *words, "config", "--format", "json"]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)["services"]


def node(text: str) -> source.Mapping:
    """A mapping from YAML."""
    found, problems = source.parse(text, "docker-compose.yml")
    assert isinstance(found, source.Mapping)
    assert problems == []
    return found
