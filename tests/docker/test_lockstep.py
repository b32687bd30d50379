"""Lockstep in containers: the same values as in processes, faster than real time."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
TESTS = ("sil-closed-left-curve", "dil-static-rig")

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("images")]


def run(folder: Path, backend: str) -> dict[str, dict[str, Any]]:
    environment = {**os.environ, "DODO_LEASES": str(folder / "leases")}
    command = [sys.executable, "-m", "dodo_dsl", "run", *TESTS, "--clock", "lockstep", "--backend", backend, "-j", "2"]
    report = folder / backend
    done = subprocess.run(
        [*command, "--report", str(report)], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=240,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return {t["slug"]: t for t in json.loads((report / "results.json").read_text())["tests"]}


def test_containers_give_what_processes_give(tmp_path: Path) -> None:
    ours, theirs = run(tmp_path, "process"), run(tmp_path, "docker")
    for slug in TESTS:
        assert {t["clock"] for t in (ours[slug], theirs[slug])} == {"lockstep"}
        assert [t["sim_s"] for t in (ours[slug], theirs[slug])] == [ours[slug]["sim_s"]] * 2
        values = [{c["name"]: c["value"] for c in t["checks"]} for t in (ours[slug], theirs[slug])]
        assert values[0] == pytest.approx(values[1], rel=1e-3), "libraries may be of other versions in images"
        assert (tmp_path / "docker" / slug / "test.rec").stat().st_size > 10_000
