"""Who cannot have the test's time, how it is built, and what the application's programs get."""

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl import package_data
from dodo_dsl.plan.model import ApplicationService
from dodo_dsl.run import application_time
from dodo_dsl.run.application_time import ApplicationTime, built, folder_of, refusal
from dodo_dsl.run.protocol import BackendError
from tests.run.scripted import plan

TIME = ApplicationTime(Path("/built/libdodo-time.so"), Path("/built/dodo-time"))


@pytest.fixture
def unbuilt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A user whose cache is empty, in an installed wheel."""
    monkeypatch.setattr(package_data, "checkout", lambda: None)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    built.cache_clear()
    yield tmp_path
    built.cache_clear()


@pytest.mark.thorough
def test_it_is_built_once_in_the_users_cache(unbuilt: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = built()
    assert made.library.is_relative_to(unbuilt)
    assert subprocess.run([made.agent, "--odd"], capture_output=True, check=False).returncode == 2
    built.cache_clear()
    monkeypatch.setenv("PATH", "")
    assert built() == made


def test_without_a_compiler_it_says_what_to_install(unbuilt: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(unbuilt))
    with pytest.raises(
        BackendError, match="DoDo's library needs a C compiler and make: apt-get install gcc make, or run"
    ):
        built()


def test_programs_get_library_folder_and_number_beside_what_is_their_own() -> None:
    services = (ApplicationService("eye"), ApplicationService("driver"))
    test = plan()
    test = replace(test, seed=7, application=replace(test.application, services=services))
    given = {"LD_PRELOAD": "/own.so", "OMP_NUM_THREADS": "4", "A": "b"}
    found = TIME.variables(given, test, "driver", "/dev/shm/x")
    assert found["LD_PRELOAD"] == "/built/libdodo-time.so:/own.so"
    assert (found["DODO_TIME"], found["DODO_TIME_SERVICE"], found["PYTHONHASHSEED"]) == ("/dev/shm/x", "1", "7")
    assert (found["OMP_NUM_THREADS"], found["OPENCV_FOR_THREADS_NUM"], found["A"]) == ("4", "1", "b")
    words = TIME.words(test, "/dev/shm/x", on_host=True)
    assert words[:3] == ("/built/dodo-time", "--folder=/dev/shm/x", "--services=2")
    assert words[-2:] == ("--nested", "--by-environment")
    assert {"--start=1700000000000000000", "--begin=1700000000000000000", "--seed=7"} <= {*words}
    assert "--by-environment" not in TIME.words(test, "/dev/shm/x", on_host=False)
    assert (folder_of(""), folder_of("dodo-0123abcd-")) == ("/dev/shm/dodo-time", "/dev/shm/dodo-0123abcd-time")


ELF = bytes([0x7F, *b"ELF", 2, 1, 1, *[0] * 9])


def program(folder: Path, content: bytes, mode: int = 0o755) -> Path:
    path = folder / "program"
    path.write_bytes(content)
    path.chmod(mode)
    return path


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda elf: elf[:18] + b"\xf3\0" + elf[20:], "a program for another processor"),
        (lambda elf: elf[:56] + b"\0\0" + elf[58:], "a statically linked program"),
        (lambda elf: elf[:70], "a statically linked program"),
        (lambda elf: elf.replace(b"GNU\0", b"Go\0\0", 1), "a program of Go"),
        (lambda elf: elf, ""),
        (lambda _: b"#!/bin/true\n", ""),
        (lambda _: b"#!\n", ""),
        (lambda _: b"", ""),
    ],
)
def test_programs_that_do_not_load_the_library_are_named(tmp_path: Path, change: object, why: str) -> None:
    assert callable(change)
    found = program(tmp_path, change(Path(os.path.realpath(sys.executable)).read_bytes()))
    said = refusal("driver", "./program", {}, tmp_path)
    assert said.startswith(f"service 'driver' starts '{found}', {why}") if why else not said


def test_so_are_those_that_change_their_user_and_the_interpreters_of_scripts(tmp_path: Path) -> None:
    alone = program(tmp_path, ELF + bytes(200))
    script = tmp_path / "script"
    script.write_text(f"#!{alone} -x\n")
    script.chmod(0o755)
    assert f"starts '{alone}', " in refusal("driver", "script", {"PATH": str(tmp_path)}, Path("/"))
    alone.chmod(0o4755)
    assert "which changes its user" in refusal("driver", str(alone), {}, Path("/"))
    assert refusal("driver", "missing", {"PATH": str(tmp_path)}, Path("/")) == ""
    for name in (str(tmp_path / "gone"), "a\0b", "/a\0b"):
        assert application_time.refusal("driver", name, {}, Path("/")) == ""
