"""``dodo run`` as a real command on compiled tests of small scripts."""

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import jsonschema

from dodo_dsl import package_data
from dodo_dsl.plan.model import Plan
from dodo_dsl.plan.plan_json import to_json
from tests.run.helpers import Bench

ROOT = Path(__file__).parents[2]


class Desk:
    """Compiled tests, a report folder, a lease folder and CIDs of their own."""

    def __init__(self, folder: Path, cids: range) -> None:
        self.folder = folder
        self._cids = cids
        (folder / "dodo.yml").write_text(f"dodo: 1\ncids: {cids[0]}-{cids[-1]}\n")
        self.bench = Bench(folder)
        self.environment = {**os.environ, "DODO_LEASES": str(folder / "leases")}

    def compiled(self, plan: Plan) -> Path:
        target = self.folder / "generated" / plan.slug
        target.mkdir(parents=True, exist_ok=True)
        application = replace(plan.application, folder="../..")
        (target / "test.json").write_text(to_json(replace(plan, cid=self._cids[0], application=application)))
        return target

    def start(self, plan: Plan, *flags: str, report: str = "report") -> "subprocess.Popen[str]":
        words = ["run", "--compiled", str(self.compiled(plan)), "--report", str(self.folder / report), *flags]
        return subprocess.Popen(
            [sys.executable, "-m", "dodo_dsl", *words],
            cwd=self.folder,
            env={**self.environment, "PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def results(self, report: str = "report") -> list[dict[str, object]]:
        document = json.loads((self.folder / report / "results.json").read_text())
        jsonschema.validate(document, json.loads((package_data.schemas() / "results.schema.json").read_text()))
        return list(document["tests"])


def wait_for(process: "subprocess.Popen[str]", text: str) -> str:
    """Reads the command's output up to a line that holds ``text``."""
    assert process.stdout is not None
    seen = ""
    for line in process.stdout:
        seen += line
        if text in line:
            return seen
    raise AssertionError(f"it ended without '{text}':\n{seen}")


def processes_with(mark: str) -> list[str]:
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            text = path.read_bytes()
        except OSError:
            continue
        if mark.encode() in text:
            found.append(path.parent.name)
    return found


def gone(mark: str, seconds: float = 30.0) -> bool:
    deadline = time.monotonic() + seconds
    while processes_with(mark):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.05)
    return True


def marks(desk: Desk) -> str:
    """What the command lines of all services of a desk hold, and nothing else's does."""
    return str(desk.folder / "test-")
