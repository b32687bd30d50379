"""The registry, compiled once."""

import shutil
from pathlib import Path

import pytest

from tests.emit.readers import ROOT, run


@pytest.fixture(scope="session")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The registry's tests, compiled beside a copy of what they refer to; not to be changed."""
    folder = tmp_path_factory.mktemp("checkout")
    for name in ("tests_registry", "examples"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "dodo.yml", folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        code, out, err = run("compile")
    assert (code, err) == (0, ""), out
    return folder / "generated"
