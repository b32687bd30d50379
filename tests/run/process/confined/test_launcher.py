"""An application's variables act on its own program, and on none of those that confine it."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.run.process import confinement
from tests.run.helpers import PASS, READY, Bench

TELLS = "import json; print(json.dumps(dict(os.environ)), flush=True); time.sleep(60)"


def launched(
    program: Path, environment: dict[str, str], *words: str
) -> "tuple[subprocess.CompletedProcess[bytes], bool]":
    """How it ended, and whether it began."""
    source = confinement.launcher_variables(environment)
    reader, began = os.pipe()
    try:
        argv = [*confinement.launcher_words(source, began, str(program)), program.name, *words]
        done = subprocess.run(argv, pass_fds=(source, began), env={}, capture_output=True, check=False)
        return done, os.read(reader, 9) == confinement.BEGAN
    finally:
        for descriptor in (source, reader, began):
            os.close(descriptor)


@pytest.mark.parametrize("environment", [{}, {"A": "b=c", "EMPTY": "", "Ü": "\udcff\n"}, {"LONG": "x" * 100_000}])
def test_a_program_gets_these_variables_and_no_others(environment: dict[str, str]) -> None:
    result, began = launched(Path("/usr/bin/env"), environment, "-0")
    assert (result.returncode, began) == (0, True)
    assert result.stdout == b"".join(os.fsencode(f"{name}={value}\0") for name, value in environment.items())


def test_a_script_without_an_interpreter_is_one_of_the_shell(tmp_path: Path) -> None:
    script = tmp_path / "script"
    script.write_text('echo "$1 $A"; exit 3\n')
    script.chmod(0o755)
    result, began = launched(script, {"A": "b"}, "first")
    assert (result.returncode, result.stdout, result.stderr, began) == (3, b"first b\n", b"", True)


def test_what_cannot_be_started_is_said(tmp_path: Path) -> None:
    result, began = launched(tmp_path / "none", {})
    assert (result.stderr, began) == (f"{tmp_path}/none: No such file or directory\n".encode(), False)


@pytest.mark.slow
@pytest.mark.parametrize("isolation", ["network", "host"])
def test_the_programs_of_the_sandbox_do_not_get_them(tmp_path: Path, isolation: str) -> None:
    """The linker complains of what it is to load and does not find: once, for the application's own program."""
    bench = Bench(tmp_path, isolation)
    traps = tmp_path / "traps"
    traps.mkdir()
    for name in ("bwrap", "setpriv", "python", "python3"):
        (traps / name).write_text(f"#!/bin/sh\ntouch {traps}/sprung\n")
        (traps / name).chmod(0o755)
    plan = bench.plan(judge=READY + "time.sleep(0.5)\n" + PASS, application=TELLS)
    (app,) = plan.application.services
    given = {"LD_PRELOAD": "/nowhere/evil.so", "LD_AUDIT": "/nowhere/audit.so", "PATH": f"{traps}:/usr/bin", "A": "b"}
    service = replace(app, process=(sys.executable, *app.process[1:]), environment=given)
    (outcome,) = bench.run(replace(plan, application=replace(plan.application, services=(service,))))
    lines = bench.log(plan, "application.app").splitlines()
    assert outcome.outcome == "passed", (outcome, lines)
    (told,) = (json.loads(line) for line in lines if line.startswith("{"))
    assert given.items() <= told.items()
    complaints = [line for line in lines if "ld.so" in line]
    assert [sum(word in line for line in complaints) for word in ("evil.so", "audit.so")] == [1, 1], lines
    assert not (traps / "sprung").exists()
