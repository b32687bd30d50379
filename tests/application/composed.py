"""What compose makes of compose files."""

import json
import subprocess
from pathlib import Path
from typing import Any

from tests.emit.readers import compose


def config(folder: Path, *words: str) -> Any:
    """The services that ``docker compose config`` shows."""
    command = [*compose(), *words, "config", "--format", "json"]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)["services"]
