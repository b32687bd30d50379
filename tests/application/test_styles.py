"""Compose files of many styles: what each service has in a test, in short, and as compose takes it."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from tests.application.compiled import Compiled, compiled, repository
from tests.emit.readers import compose

FOLDER = Path(__file__).parent
STYLES = sorted(path.name for path in (FOLDER / "good").iterdir())
ON_RIGS = ("truck", "usecase")
"""Those that have hardware."""
PATHS = ("/opt/models", *(f"~/{name}" for name in ("kiwi-recordings", "models", "recordings")))
"""What 'paths' in dodo.yml names: styles mount these folders of the host."""
SUMMARY = FOLDER / "styles.yml"
KEYS = (
    "image",
    "build",
    "entrypoint",
    "command",
    "environment",
    "env_file",
    "volumes",
    "volumes_from",
    "devices",
    "network_mode",
)


def made(style: str, folder: Path, way: str) -> Compiled:
    root = repository(folder)
    shutil.copytree(FOLDER / "good", root / "styles")
    files = sorted(p.name for p in (root / "styles" / style).iterdir() if p.suffix in (".yml", ".yaml"))[::-1]
    return compiled(root, way=way, application=[f"styles/{style}/{file}" for file in files], paths=list(PATHS))


def way_of(style: str) -> str:
    return "hil" if style in ON_RIGS else "network"


def summary(test: Compiled) -> dict[str, list[str]]:
    """A line for each key of each service that says what it runs, with what, and after whom."""
    assert test.plan is not None
    found = {}
    for name, service in test.services.items():
        lines = [f"{key}: {json.dumps(service[key])}" for key in KEYS if key in service]
        after = [
            f"{other} {how['condition']}" for other, how in service["depends_on"].items() if other in test.services
        ]
        found[name] = [*lines, *([f"after: {', '.join(after)}"] if after else [])]
    return found


@pytest.mark.parametrize("style", STYLES)
def test_summaries(style: str, tmp_path: Path, update_goldens: bool) -> None:
    test = made(style, tmp_path, way_of(style))
    assert test.errors == []
    known = yaml.safe_load(SUMMARY.read_text()) if SUMMARY.exists() else {}
    if update_goldens:
        known[style] = summary(test)
        SUMMARY.write_text(yaml.safe_dump(known, width=1000))
    assert summary(test) == known[style]


@pytest.mark.slow
@pytest.mark.parametrize("style", STYLES)
def test_compose_accepts_them(style: str, tmp_path: Path) -> None:
    test = made(style, tmp_path, way_of(style))
    said = subprocess.run([*compose(), "config", "-q"], cwd=test.write(), capture_output=True, text=True, check=False)
    unset = [line for line in said.stderr.splitlines() if "variable is not set" not in line]
    assert (said.returncode, unset) == (0, [])
