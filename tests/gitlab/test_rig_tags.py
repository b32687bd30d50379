"""The tags of hil jobs, as a team compiles the tests that ship, and what such a test does without a rig."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl import compiler
from dodo_dsl.plan.model import Plan, Suite
from dodo_dsl.plan.pipeline import DEFAULT_TAGS, pipeline
from dodo_dsl.plan.plan_json import from_json, to_json
from dodo_dsl.run.rigs.ports import refuse_unattended
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.spec.load import Settings
from dodo_dsl.spec.rig import SIMULATION_TAG

ROOT = Path(__file__).parents[2]
TESTS = ("hil-camera", "hil-dynamic", "hil-closed-oval", "sil-closed-straight")
CAMERA = "camera: {source: /dev/video0, width: 640, height: 480}"
KIWI = f"kiwi: {{kind: dynamic, cid: 121, serial: /dev/ttyACM0, {CAMERA}}}"
DESK = f"desk: {{kind: static, cid: 122, {CAMERA}}}"
MODELS = [f"{kind}-model: {{kind: {kind}, emulated: true}}" for kind in ("static", "dynamic", "circle")]
KINDS = ("hil-static", "hil-dynamic", "hil-dynamic hil-circle")


def plans(folder: Path, rigs: list[str], registry: str, emulate: bool = False) -> dict[str, Plan]:
    """Those of the shipped tests, or of a copy, in a repository with these rigs."""
    if registry != "dodo:":
        shutil.copytree(ROOT / "tests_registry", folder / registry)
    (folder / "dodo.yml").write_text(f"dodo: 1\nregistry: ['{registry}']\nrigs: {{{', '.join(rigs)}}}\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        checked = compiler.load([], [ROOT / "examples/kiwi/docker-compose.yml"], Settings(emulate=emulate))
        assert checked.ok, checked.diagnostics
        found = compiler.plan(checked, folder / "generated").compiled.suite.plans
    return {plan.slug: plan for plan in found if plan.slug in TESTS}


@pytest.mark.parametrize(
    ("registry", "rigs", "tags", "groups", "real"),
    [
        ("dodo:", [], KINDS, ("static", "dynamic", "circle"), ()),
        ("tests", [], KINDS, ("static", "dynamic", "circle"), ()),
        ("dodo:", [KIWI, DESK], KINDS, ("desk", "kiwi", "circle"), ("hil-camera", "hil-dynamic")),
        ("tests", [KIWI, *MODELS], ("sil", "hil-dynamic", "sil"), ("", "kiwi", ""), ("hil-dynamic",)),
        ("dodo:", [KIWI[:-1] + ", emulated: true}"], ("hil-static", "sil", KINDS[2]), ("static", "", "circle"), ()),
        ("dodo:", ["bare: {kind: dynamic, cid: 121}"], KINDS, ("static", "dynamic", "circle"), ()),
    ],
)
def test_jobs_have_the_tag_of_their_rig_s_kind(
    registry: str,
    rigs: list[str],
    tags: tuple[str, ...],
    groups: tuple[str, ...],
    real: tuple[str, ...],
    tmp_path: Path,
) -> None:
    found = plans(tmp_path, rigs, registry)
    made = pipeline(Suite(tuple(found.values())), Path("generated"))
    jobs = {job.name: job for job in made.jobs}
    assert [jobs[name].tags or DEFAULT_TAGS for name in TESTS] == [*(tuple(tag.split()) for tag in tags), ("sil",)]
    assert [(jobs[name].rig, not jobs[name].tags) for name in TESTS[:3]] == [(one, not one) for one in groups]
    assert tuple(name for name in TESTS if found[name].is_real) == real
    for name, tag, group in zip(TESTS, tags, groups, strict=False):
        plan = from_json(to_json(found[name]))
        assert plan == found[name] and plan.lacks_rig == tag.endswith(f"hil-{group}")
        if plan.lacks_rig:
            with pytest.raises(RigProblem, match=f"needs a {group} rig, and dodo.yml has none: run it with --emulate"):
                refuse_unattended(plan)
            plan = replace(plan, tag=SIMULATION_TAG)
        refuse_unattended(plan)


def test_all_rigs_can_be_emulated_at_once(tmp_path: Path) -> None:
    found = plans(tmp_path, [KIWI, KIWI.replace("kiwi", "other").replace("121", "123"), DESK], "dodo:", emulate=True)
    assert [(found[name].rig, found[name].is_real) for name in TESTS[:3]] == [
        ("desk", False),
        ("kiwi", False),
        ("circle", False),
    ]
