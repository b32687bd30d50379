"""What copies folders for an application counts before."""

import subprocess
from pathlib import Path

import pytest

from dodo_dsl.emit.containers import copy_command
from dodo_dsl.plan.model import Application
from dodo_dsl.spec.sandbox_limits import SandboxLimits
from tests.application.compiled import repository

LIMITS = SandboxLimits(copies=1_000_000, copied_files=10)


@pytest.fixture
def team(tmp_path: Path) -> Path:
    """A repository with folders of 600 kB, and one of many files."""
    root = repository(tmp_path, {f"{name}/file": "x" * 600_000 for name in ("a", "b", "tests/own")})
    (root / "many").mkdir()
    for number in range(11):
        (root / "many" / str(number)).touch()
    (root / "large").symlink_to("/usr")
    return root


@pytest.mark.parametrize(("names", "lines"), [(("a",), ""), (("a", "b"), "copies"), (("many",), "copied-files")])
def test_what_copies_counts_first(names: tuple[str, ...], lines: str, team: Path, tmp_path: Path) -> None:
    """The program of a compiled test, as its shell gets it from compose, in other folders."""
    copies = {f"files-{number}": f"../../{name}" for number, name in enumerate(names)}
    script = copy_command(Application("../..", (), copies=copies, limits=LIMITS)).replace("$$", "$")
    for number, name in enumerate(names):
        (tmp_path / "to" / f"files-{number}").mkdir(parents=True)
        script = script.replace(f"/from/files-{number}", str(team / name))
    for old, new in (("/to/", f"{tmp_path}/to/"), ("/run/copied", f"{tmp_path}/copied"), ("sleep infinity", "true")):
        script = script.replace(old, new)
    ran = subprocess.run(["sh", "-c", script], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (1 if lines else 0, "")
    assert (tmp_path / "copied").exists() == (not lines)
    if lines:
        assert ran.stdout.startswith(f"'./{names[-1]}' holds ") and f"'{lines}' in 'sandbox'" in ran.stdout


def test_the_folder_itself_does_not_count_as_one_of_its_files(team: Path, tmp_path: Path) -> None:
    (tmp_path / "to").mkdir()
    for most, code in ((11, 0), (10, 1)):
        limits = SandboxLimits(copies=1_000_000, copied_files=most)
        script = copy_command(Application("../..", (), copies={"files-0": "../../many"}, limits=limits))
        script = script.replace("/from/files-0", str(team / "many")).replace("/to/files-0", str(tmp_path / "to"))
        script = script.replace("touch /run/copied", "true").replace("sleep infinity", "true").replace("$$", "$")
        assert subprocess.run(["sh", "-c", script], capture_output=True, check=False).returncode == code
