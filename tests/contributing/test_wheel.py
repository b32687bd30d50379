"""The wheel: enough is in it to compile without the libraries of running."""

import compileall
import os
import shutil
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("wheel")]

ROOT = Path(__file__).parents[2]
PARTS = ("dodo_dsl", "locks", "schemas", "services", "templates", "tests_registry")
FILES = ("pyproject.toml", "README.md", "LICENSE")
RUNNING = ("av", "cv2", "docker", "matplotlib", "scipy")
"""Libraries that draw, decode and run, which compiling has no use for."""
WITHOUT = f"""\
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {RUNNING!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Missing())
sys.path.insert(0, sys.argv.pop(1))
from dodo_dsl import package_data
from dodo_dsl.__main__ import run
assert package_data.root().name == "_data", "the wheel's own files"
sys.exit(run())
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    sources, skipped = tmp_path_factory.mktemp("sources"), shutil.ignore_patterns("__pycache__", "*.pyc")
    for name in PARTS:
        shutil.copytree(ROOT / name, sources / name, ignore=skipped)
    for name in FILES:
        shutil.copyfile(ROOT / name, sources / name)
    words = ("-m", "hatchling", "build", "--target", "wheel")
    subprocess.run([sys.executable, *words], cwd=sources, check=True, capture_output=True)
    (made,) = (sources / "dist").iterdir()
    return made


def test_tests_compile_without_the_libraries_of_running(wheel: Path, tmp_path: Path) -> None:
    with ZipFile(wheel) as packed:
        packed.extractall(tmp_path / "site")
    compileall.compile_dir(tmp_path / "site", quiet=1)  # as pip does
    repository = tmp_path / "repository"
    repository.mkdir()
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    for words in (["new", "--application"], ["new", "sil-second"], ["compile", "--check"], ["compile"]):
        command = [sys.executable, "-I", "-c", WITHOUT, str(tmp_path / "site"), *words]
        done = subprocess.run(command, cwd=repository, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    assert (repository / "generated/sil-first/test.json").is_file()
    assert (repository / "generated/sil-second/test.json").is_file()
    assert (repository / "generated/child.gitlab-ci.yml").is_file()
