"""Folders that an application mounts: missing, or too large to be copied."""

import subprocess
from pathlib import Path

import pytest

from dodo_dsl.emit.containers import copy_command
from dodo_dsl.plan.model import Application
from dodo_dsl.spec.sandbox_limits import SandboxLimits
from tests.application.compiled import compiled, repository

LIMITS = SandboxLimits(copies=1_000_000, copied_files=10)
SANDBOX = {"copies": "1 MB", "copied-files": 10}


@pytest.fixture
def team(tmp_path: Path) -> Path:
    """A repository with folders of 600 kB, and one of many files."""
    root = repository(tmp_path, {f"{name}/file": "x" * 600_000 for name in ("a", "b", "tests/own")})
    (root / "many").mkdir()
    for number in range(11):
        (root / "many" / str(number)).touch()
    (root / "large").symlink_to("/usr")
    return root


def told(team: Path, *volumes: object, **sandbox: object) -> list[str]:
    """The limits that the copies of a test are beyond: what a warning names as the way out."""
    service = {"image": "x", "command": "--cid=1", "volumes": list(volumes)}
    test = compiled(team, {"services": {"a": service}}, sandbox={**SANDBOX, **sandbox})
    assert test.errors == []
    assert all((one.severity, one.line) == ("warning", 5) for one in test.told)
    return [word for one in test.told for word in ("copies", "copied-files") if f"'{word}'" in one.text]


@pytest.mark.parametrize(
    ("volumes", "expected"),
    [
        (["./a:/a"], []),
        (["./a:/a", "./a:/again", "./b:/b:ro"], []),
        (["./a:/a", "./b:/b"], ["copies"]),
        (["./many:/m"], ["copied-files"]),
        (["./many:/m:ro", "./gone:/g", "./a/file:/f"], []),
    ],
)
def test_what_is_too_large(volumes: list[str], expected: list[str], team: Path) -> None:
    assert told(team, *volumes) == expected


def test_tests_and_history_do_not_count(team: Path) -> None:
    (team / ".git" / "file").write_bytes(b"x" * 600_000)
    assert told(team, ".:/app", **{"copies": "1.7 MB", "copied-files": 100}) == []


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
    """Neither where they are counted before a test, nor by its program."""
    (tmp_path / "to").mkdir()
    for most, code in ((11, 0), (10, 1)):
        limits = SandboxLimits(copies=1_000_000, copied_files=most)
        assert bool(told(team, "./many:/app", **{"copied-files": most})) == bool(code)
        script = copy_command(Application("../..", (), copies={"files-0": "../../many"}, limits=limits))
        script = script.replace("/from/files-0", str(team / "many")).replace("/to/files-0", str(tmp_path / "to"))
        script = script.replace("touch /run/copied", "true").replace("sleep infinity", "true").replace("$$", "$")
        assert subprocess.run(["sh", "-c", script], capture_output=True, check=False).returncode == code


def test_folders_that_are_asked_for_and_not_there(team: Path) -> None:
    """Of others the test has an empty one, as compose makes it."""
    assert told(team, {"type": "bind", "source": "./gone", "target": "/g", "bind": {"create_host_path": True}}) == []
    assert not (team / "gone").exists()
