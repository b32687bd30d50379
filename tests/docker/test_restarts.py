"""An engine takes and refuses the same restart policies as DoDo does."""

import secrets
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.application.compose_values import RIGHT, RIGHT_FOR_UP, WRONG_FOR_UP, compose_file
from tests.emit.readers import compose

pytestmark = pytest.mark.engine


def starts(values: Sequence[str], image: str, folder: Path) -> bool:
    """Whether an engine makes a container with each of the values."""
    one = compose_file("network_mode: none\n    {}", image)
    service = one[one.index("  a:") : one.index("volumes:")]
    services = "".join(service.replace("a:", f"a{n}:", 1).format(value) for n, value in enumerate(values))
    (folder / "compose.yml").write_text(f"services:\n{services}volumes: {{known: }}\n")
    command = [*compose(), "-p", f"dodo-restart-{secrets.token_hex(3)}"]
    try:
        return not subprocess.run([*command, "create"], cwd=folder, capture_output=True, check=False).returncode
    finally:
        subprocess.run([*command, "down", "--volumes"], cwd=folder, capture_output=True, check=True)


def test_restart_policies(base_image: str, tmp_path: Path) -> None:
    right = [value for value in RIGHT if value.startswith("restart:")] + RIGHT_FOR_UP
    assert starts(right, base_image, tmp_path)
    judged = {value: starts([value], base_image, tmp_path) for value in WRONG_FOR_UP}
    assert judged == dict.fromkeys(WRONG_FOR_UP, False)
