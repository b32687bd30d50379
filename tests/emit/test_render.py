"""Compiled output: equal to the goldens, and the same for any folder and hash seed."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
import yaml

from dodo_dsl import compiler
from dodo_dsl.emit.render import CHILD, render_pipeline, render_plan
from dodo_dsl.plan.model import Suite
from dodo_dsl.plan.pipeline import pipeline
from tests.emit.readers import ROOT, tree

GOLDEN = Path(__file__).parent / "golden"
WHOLE = "sil-closed-straight"
"""The test whose compose files are compared as they are."""
JOBS = (WHOLE, "dil-kiwi-track", "hil-camera")
PLAN = "sil-closed-straight/plan.yml"
"""Its plan in few lines."""
SUMMARY = "summary.yml"
_DECIDED = ("level", "kind", "clock", "isolation", "timeout_s", "cid", "subnet", "tag", "rig", "lockstep", "truth")


@pytest.mark.thorough
def test_goldens(update_goldens: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    checked = compiler.load([])
    made = compiler.plan(checked, Path("generated"))
    assert not made.problems
    first = {plan.spec: plan.slug for plan in reversed(made.compiled.suite.plans)}  # one instance of a matrix
    plans = [plan for plan in made.compiled.suite.plans if first[plan.spec] == plan.slug]
    written = {plan.slug: render_plan(plan) for plan in plans}
    whole = {file.path: file.text for file in written[WHOLE]}
    files = {path: text for path, text in whole.items() if not path.endswith("/test.json")}
    files[PLAN] = _plan(whole[f"{WHOLE}/test.json"])
    jobs = tuple(plan for plan in plans if plan.slug in JOBS)
    files[CHILD] = render_pipeline(pipeline(Suite(jobs), Path("generated"))).text
    summaries = {slug: _summary({Path(file.path).name: file.text for file in test}) for slug, test in written.items()}
    files[SUMMARY] = yaml.safe_dump(summaries, sort_keys=False, width=150)
    if update_goldens:
        shutil.rmtree(GOLDEN, ignore_errors=True)
        for path, text in files.items():
            (GOLDEN / path).parent.mkdir(parents=True, exist_ok=True)
            (GOLDEN / path).write_text(text)
    golden = {p.relative_to(GOLDEN).as_posix(): p.read_text() for p in GOLDEN.rglob("*") if p.is_file()}
    assert files == golden


def _plan(text: str) -> str:
    """A plan without the application's compose file, which stands beside it, and with flags as words."""
    plan = json.loads(text)
    del plan["application"]["compose"]
    for service in plan["services"]:
        service["flags"] = [f"{flag['kind']} {flag['name']}={flag['value']}" for flag in service["flags"]]
    plan["source_map"] = {key: ":".join(map(str, place.values())) for key, place in plan["source_map"].items()}
    return yaml.safe_dump(plan, sort_keys=False, width=150, default_flow_style=None)


def _summary(files: Mapping[str, str]) -> dict[str, object]:
    """What a compiled test has of its own: what the plan decided, and image and command of DoDo's services."""
    plan = json.loads(files["test.json"])
    summary: dict[str, object] = {
        "decided": " ".join(f"{key}={json.dumps(plan[key])}" for key in _DECIDED if plan[key] not in ("", None, []))
    }
    for name, text in files.items():
        if name.endswith(".compose.yml") and not name.startswith("application"):
            services = yaml.safe_load(text)["services"]
            services.pop("sandbox", None)
            words = {key: [service.get("image", ""), service.get("command", "")] for key, service in services.items()}
            summary[name.partition(".")[0]] = {
                key: f"{image} {command if isinstance(command, str) else ' '.join(command)}"
                for key, (image, command) in words.items()
            }
    return summary


@pytest.mark.slow
def test_output_is_the_same_for_any_hash_seed_and_folder(generated: Path, tmp_path: Path) -> None:
    """Against the output of this process, whose hash seed is another one."""
    place = tmp_path / "deeper" / "b"
    shutil.copytree(generated.parent, place, ignore=shutil.ignore_patterns("generated"))
    for seed in ("1", "2"):
        shutil.rmtree(place / "generated", ignore_errors=True)
        environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(ROOT)}
        subprocess.run([sys.executable, "-m", "dodo_dsl", "compile"], cwd=place, env=environment, check=True)
        assert tree(place / "generated") == tree(generated)


def test_no_absolute_path_and_nothing_temporary(generated: Path) -> None:
    for name, content in tree(generated).items():
        assert str(generated.parent).encode() not in content, name
    hidden = {path.name for path in generated.rglob(".*")}
    assert hidden == {".env"}
