"""Folders that an application mounts: missing, or too large to be copied."""

import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.application.access.model import Access
from dodo_dsl.application.mounts import large_folders
from dodo_dsl.application.read import read_application
from dodo_dsl.emit.containers import copy_command
from dodo_dsl.plan.model import Application
from dodo_dsl.spec.sandbox_limits import SandboxLimits
from tests.application.applications import problems

LIMITS = SandboxLimits(copies=100_000, copied_files=10)
WAY_OUT = "mount it read-only (:ro), name it under 'paths' in dodo.yml, or raise '{}' in 'sandbox' there"


@pytest.fixture
def team(tmp_path: Path) -> Path:
    """A repository with folders of 60 kB, and one of many files."""
    for name in ("a", "b", "tests", ".git"):
        (tmp_path / "team" / name).mkdir(parents=True)
        (tmp_path / "team" / name / "file").write_bytes(b"x" * 60_000)
    (tmp_path / "team" / "many").mkdir()
    for number in range(11):
        (tmp_path / "team" / "many" / str(number)).touch()
    (tmp_path / "team" / "large").symlink_to("/usr")
    return tmp_path / "team"


def told(team: Path, limits: SandboxLimits, *volumes: str) -> list[str]:
    (team / "docker-compose.yml").write_text(
        f"services: {{a: {{image: x, command: --cid=1, volumes: {list(volumes)}}}}}\n"
    )
    source, found = read_application(team / "docker-compose.yml", Access((str(team),)), limits)
    assert source is not None, found
    found = list(large_folders(source, [team / "tests"]))
    assert all((p.severity, p.span.line) == ("warning", 1) for p in found)
    return [f"{p.message}: {p.hint}" for p in found]


LARGE = f"'./b' holds 0 MB, and the copies of a test may hold 0 MB: {WAY_OUT.format('copies')}"
MANY = f"'./many' holds more than 10 files, and the copies of a test may hold 10: {WAY_OUT.format('copied-files')}"


@pytest.mark.parametrize(
    ("volumes", "expected"),
    [
        (["./a:/a"], []),
        (["./a:/a", "./a:/again", "./b:/b:ro"], []),
        (
            ["./a:/a", "./b:/b"],
            ["'./b' holds 0 MB, and the copies of a test may hold 0 MB: " + WAY_OUT.format("copies")],
        ),
        (["./many:/m"], [MANY]),
        (["./many:/m:ro", "./gone:/g", "./a/file:/f"], []),
    ],
)
def test_what_is_too_large(volumes: list[str], expected: list[str], team: Path) -> None:
    assert told(team, LIMITS, *volumes) == expected


def test_tests_and_history_do_not_count(team: Path) -> None:
    assert told(team, replace(LIMITS, copies=170_000, copied_files=100), ".:/app") == []


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
        assert ran.stdout.startswith(f"'./{names[-1]}' holds ") and ran.stdout.endswith(f"{WAY_OUT.format(lines)}\n")


def test_the_folder_itself_does_not_count_as_one_of_its_files(team: Path, tmp_path: Path) -> None:
    """Neither where they are counted before a test, nor by its program."""
    (tmp_path / "to").mkdir()
    for most, code in ((11, 0), (10, 1)):
        limits = replace(LIMITS, copied_files=most)
        assert bool(told(team, limits, "./many:/app")) == bool(code)
        script = copy_command(Application("../..", (), copies={"files-0": "../../many"}, limits=limits))
        script = script.replace("/from/files-0", str(team / "many")).replace("/to/files-0", str(tmp_path / "to"))
        script = script.replace("touch /run/copied", "true").replace("sleep infinity", "true").replace("$$", "$")
        assert subprocess.run(["sh", "-c", script], capture_output=True, check=False).returncode == code


def test_folders_that_are_asked_for_and_not_there(team: Path) -> None:
    """Of others the test has an empty one, as compose makes it."""
    long = "{type: bind, source: ./gone, target: /g, bind: {create_host_path: %s}}"
    for word, count in (("false", 1), ("true", 0)):
        found = problems(f"services: {{a: {{image: x, command: --cid=1, volumes: [{long % word}]}}}}\n", team)
        assert [p.message for p in found] == [
            "there is no file or folder './gone', and 'create_host_path: false' requires it"
        ] * count
    assert not (team / "gone").exists()
