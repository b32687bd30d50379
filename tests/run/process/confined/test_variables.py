"""An application's variables act on its own program, and on none of those that confine it."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from tests.run.helpers import AFTER_START, PASS, READY, STARTED, Bench

TELLS = "import json; print(json.dumps(dict(os.environ)), flush=True)"


@pytest.mark.slow
@pytest.mark.parametrize("isolation", ["network", "host"])
def test_the_programs_of_the_sandbox_do_not_get_them(tmp_path: Path, isolation: str) -> None:
    """The linker complains of what it is to load and does not find: once, for the application's own program."""
    bench = Bench(tmp_path, isolation)
    traps = tmp_path / "traps"
    traps.mkdir()
    for name in ("bwrap", "python", "python3"):
        (traps / name).write_text(f"#!/bin/sh\ntouch {traps}/sprung\n")
        (traps / name).chmod(0o755)
    plan = bench.plan(judge=READY + AFTER_START + PASS, application=f"{TELLS}\n{STARTED}time.sleep(60)")
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
