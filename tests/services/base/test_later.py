"""Services of which there is only a manifest say so, and never pass for one that works."""

import subprocess
import sys

import pytest
import yaml

from tests.services.base.conftest import ROOT

FOLDERS = [p.parent for p in sorted((ROOT / "services").glob("*/__main__.py")) if "later" in p.read_text()]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda p: p.name)
def test_it_says_so_and_is_never_ready(folder):
    parameters = yaml.safe_load((folder / "service.yml").read_text())["parameters"]
    needed = [f"--{name}={about['example']}" for name, about in parameters.items() if about.get("required")]
    command = [sys.executable, "-m", f"services.{folder.name}", "--cid=254", *needed]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    name = folder.name.replace("_", "-")
    sentence = f"the program of {name} comes with a later version; this one has its manifest only"
    assert result.stderr == f"{name}: CRITICAL: {sentence}\n"
    assert (result.returncode, result.stdout) == (2, "")
    assert "program comes with a later version" in " ".join((folder / "README.md").read_text().split())
