"""Compiled output: as the goldens have it, the same everywhere, and accepted by those who will read it."""

import json
import os
import shutil
import subprocess
import sys
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl import compiler
from dodo_dsl.cli.main import main
from dodo_dsl.emit.pipeline import CHILD
from dodo_dsl.emit.render import render_plan
from dodo_dsl.plan.plan_json import from_json, to_json

ROOT = Path(__file__).parents[2]
GOLDEN = Path(__file__).parent / "golden"
PLUGIN = Path.home() / ".docker/cli-plugins/docker-compose"


def run(*words: str) -> tuple[int, str, str]:
    stdout, stderr = StringIO(), StringIO()
    code = main(words, stdout, stderr)
    return code, stdout.getvalue(), stderr.getvalue()


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The registry, compiled beside a copy of what it refers to."""
    folder = tmp_path_factory.mktemp("checkout")
    for name in ("tests_registry", "examples"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "dodo.yml", folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        code, out, err = run("compile")
    assert (code, err) == (0, ""), out
    return folder / "generated"


def test_goldens(update_goldens: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    checked = compiler.load([])
    made = compiler.plan(checked, Path("generated"))
    assert not made.problems
    first = {plan.spec: plan.slug for plan in reversed(made.compiled.suite.plans)}  # one instance of a matrix
    plans = [plan for plan in made.compiled.suite.plans if first[plan.spec] == plan.slug]
    files = {file.path: file.text for plan in plans for file in render_plan(plan)} | {CHILD: made.pipeline.text}
    if update_goldens:
        shutil.rmtree(GOLDEN, ignore_errors=True)
        for path, text in files.items():
            (GOLDEN / path).parent.mkdir(parents=True, exist_ok=True)
            (GOLDEN / path).write_text(text)
    golden = {p.relative_to(GOLDEN).as_posix(): p.read_text() for p in GOLDEN.rglob("*") if p.is_file()}
    assert files == golden


def test_output_is_the_same_for_any_hash_seed_and_folder(generated: Path, tmp_path: Path) -> None:
    trees = []
    for seed, place in (("1", tmp_path / "a"), ("2", tmp_path / "deeper" / "b")):
        shutil.copytree(generated.parent, place, ignore=shutil.ignore_patterns("generated"))
        environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(ROOT)}
        subprocess.run([sys.executable, "-m", "dodo_dsl", "compile"], cwd=place, env=environment, check=True)
        trees.append(tree(place / "generated"))
    assert trees[0] == trees[1] == tree(generated)


def tree(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_no_absolute_path_and_nothing_temporary(generated: Path) -> None:
    for name, content in tree(generated).items():
        assert str(generated.parent).encode() not in content, name
    hidden = {path.name for path in generated.rglob(".*")}
    assert hidden == {".env"}


def test_plan_survives_its_file(generated: Path) -> None:
    for path in generated.glob("*/test.json"):
        text = path.read_text()
        assert to_json(from_json(text)) == text


def check_schema(*words: str) -> None:
    program = Path(sys.executable).parent / "check-jsonschema"
    result = subprocess.run([program, *words], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_gitlab_accepts_the_child_pipeline(generated: Path) -> None:
    transform = ("--builtin-schema", "vendor.gitlab-ci", "--data-transform", "gitlab-ci")
    check_schema(*transform, str(generated / "child.gitlab-ci.yml"))


def test_compose_spec_accepts_every_layer(generated: Path) -> None:
    check_schema("--builtin-schema", "vendor.compose-spec", *map(str, sorted(generated.glob("*/*.compose.yml"))))


def compose() -> list[str]:
    if PLUGIN.is_file():
        return [str(PLUGIN)]
    probe = ["docker", "compose", "version"]
    if shutil.which("docker") and not subprocess.run(probe, capture_output=True, check=False).returncode:
        return ["docker", "compose"]
    pytest.skip("Compose v2 is not installed")


def test_compose_accepts_every_test(generated: Path) -> None:
    for folder in sorted(p.parent for p in generated.glob("*/test.json")):
        result = subprocess.run([*compose(), "config", "-q"], cwd=folder, capture_output=True, text=True, check=False)
        assert (result.returncode, result.stderr) == (0, ""), folder.name


def test_compose_sees_one_project_with_all_services(generated: Path) -> None:
    folder = generated / "sil-closed-straight"
    result = subprocess.run([*compose(), "config", "--format", "json"], cwd=folder, capture_output=True, check=True)
    project = json.loads(result.stdout)
    plan = from_json((folder / "test.json").read_text())
    expected = {"sandbox", *(s.name for s in plan.services), *(s.name for s in plan.application.services)}
    assert project["name"] == "dodo-sil-closed-straight"
    assert set(project["services"]) == expected
    for name, service in project["services"].items():
        assert "network_mode" not in service, name
        assert service["ipc"] == ("shareable" if name == "sandbox" else "service:sandbox")
        assert any(f"--cid={plan.cid}" in word for word in service["command"]) or name == "sandbox"


@pytest.mark.parametrize("name", ["docker-compose.yml", "compose.yaml"])
def test_compose_sees_the_test_whatever_lies_above_it(generated: Path, name: str) -> None:
    """Compose looks for a file in all folders above, and takes one before it reads the test's ``.env``."""
    foreign = generated.parent / name
    foreign.write_text("services: {stranger: {image: stranger, network_mode: host}}\n")
    try:
        test_compose_sees_one_project_with_all_services(generated)
    finally:
        foreign.unlink()


def test_check_says_when_output_is_stale(generated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(generated.parent)
    assert run("compile", "--check")[0] == 0
    layer = generated / "sil-closed-straight" / "action.compose.yml"
    before = layer.read_text()
    layer.write_text(before.replace("init: true", "init: false"))
    code, out, _ = run("compile", "--check")
    assert code == 1
    assert "-    init: false\n+    init: true\n" in out
    assert layer.read_text() != before
    assert run("compile")[0] == 0
    assert layer.read_text() == before


def count(generated: Path) -> int:
    return len(list(generated.glob("*/test.json")))


def test_a_long_difference_is_shown_when_asked_for(generated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(generated.parent)
    layers = [generated / name / "action.compose.yml" for name in ("sil-closed-left-curve", "sil-closed-straight")]
    before = [layer.read_text() for layer in layers]
    for layer in layers:
        layer.write_text("# of somebody else\n" * 50)
    (generated / "dil-kiwi-track/.env").unlink()
    code, out, _ = run("compile", "--check")
    names = "dil-kiwi-track, sil-closed-left-curve, sil-closed-straight"
    state = f"{count(generated)} tests checked: generated is stale; dodo compile brings it up to date\n"
    assert (code, out) == (1, f"stale in generated: {names}; --diff shows how\n{state}")
    code, out, _ = run("compile", "--check", "--diff")
    assert (code, out.count("-# of somebody else\n")) == (1, 100)
    assert out.endswith(state)
    assert run("compile")[0] == 0
    assert [layer.read_text() for layer in layers] == before


def test_tests_that_are_gone_leave_the_output(generated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(generated.parent)
    (generated / "mine").mkdir(exist_ok=True)
    (generated / "mine" / "notes.txt").write_text("keep")
    others = count(generated) - 1
    code, out, _ = run("compile", "sil-closed-straight")
    removed = f"removed {others} stale tests: dil-kiwi-track, "
    assert (code, out[: out.index(removed)]) == (0, "1 test compiled into generated\n")
    assert out.endswith(f" and {others - 8} more\n")
    assert not (generated / "sil-closed-left-curve").exists()
    assert (generated / "mine" / "notes.txt").exists()
    shutil.rmtree(generated / "mine")
    assert run("compile")[0] == 0
    assert (generated / "sil-closed-left-curve").is_dir()
