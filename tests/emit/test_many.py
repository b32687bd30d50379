"""Specs made at random: whatever they hold, those who read the output take it.

DODO_MANY says how many; 1,000 take some two minutes.
"""

import os
import random
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.emit.readers import ROOT, check_schema, compose, first_instances, run, tree

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("many")]
NUMBER = int(os.environ.get("DODO_MANY", "20"))
TEXTS = (
    "Drive.",
    'He said "go": {now}',
    "{{ 7 * 7 }} ${HOME} $(id) `id` %d",
    "#!&*?|>-",
    "ö🚗\u2028",
    "a\nb",
    "yes",
    "0x10",
    "'",
    "${matrix}",
    "---",
    "$$",
    "{% raw %}",
    "- x: y",
    "\\n",
    "null",
    "@",
    "  padded  ",
    "1.0",
    "C:\\dir",
)


def spec(dice: random.Random, name: str) -> dict[str, object]:
    """A spec without mistakes, of any level and kind that a closed or an open loop can have."""
    level, closed = dice.choice((("sil", True), ("sil", False), ("hil", True)))
    freq = f"{dice.choice((5, 10, 20))} Hz"
    camera = {"uses": "virtual-camera", "with": {"map-path": "../maps/straight", "freq": freq}}
    pose = {
        "uses": "integrator",
        "with": {"freq": "100 Hz", "x": f"{dice.uniform(-4, 4):.3f} cm", "yaw": f"{dice.random()} rad"},
    }
    text = dice.choice(TEXTS)
    body: dict[str, object] = {
        "dodo": 1,
        "name": name,
        "description": text if "${matrix" not in text else "x",
        "level": level,
        "kind": "closed-loop" if closed else "open-loop",
        "timeout": f"{dice.randint(70, 4000)} s",
        "seed": dice.randrange(1 << 32),
        "environment": {dice.choice(("camera", "eye")): camera},
        "action": {"vehicle": {"uses": "dynamic-model", "with": {"freq": "100 Hz"}}, "pose": pose},
        "evaluation": {
            "track": {"uses": "collision", "with": {"goal": "finish", "walls": ["left"], "max-time": "50 s"}}
        },
    }
    if level == "hil":
        body["rig"] = dice.choice(("emulated", "arm"))
    elif dice.random() < 0.2:
        body["isolation"] = "host" if dice.random() < 0.1 else "network"
    if dice.random() < 0.3:
        body["matrix"] = {"speed": [str(n) for n in range(dice.randint(1, 3))], "text": [f"a {n}" for n in range(2)]}
        body["description"] = "${matrix.text} at ${matrix.speed}"
    return body


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("many")
    dice = random.Random(1)
    shutil.copytree(ROOT / "tests_registry" / "maps", folder / "tests" / "maps")
    shutil.copytree(ROOT / "examples" / "kiwi", folder / "kiwi", ignore=shutil.ignore_patterns("__pycache__"))
    rigs = {"arm": {"kind": "dynamic", "cid": 120, "serial": "/dev/ttyACM0"}}
    deployment = {"dodo": 1, "registry": ["tests"], "application": "kiwi/docker-compose.yml", "rigs": rigs}
    (folder / "dodo.yml").write_text(yaml.safe_dump(deployment))
    for number in range(NUMBER):
        name = f"test-{number}"
        (folder / "tests" / name).mkdir()
        text = yaml.safe_dump(spec(dice, name), allow_unicode=dice.random() < 0.5, sort_keys=False)
        (folder / "tests" / name / f"{name}.dodo.yml").write_text(text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        code, out, err = run("compile")
    assert (code, err) == (0, ""), out
    return folder / "generated"


def test_the_schemas_accept_it(generated: Path) -> None:
    transform = ("--builtin-schema", "vendor.gitlab-ci", "--data-transform", "gitlab-ci")
    check_schema(*transform, str(generated / "child.gitlab-ci.yml"))
    layers = [str(layer) for folder in first_instances(generated) for layer in sorted(folder.glob("*.compose.yml"))]
    assert len(layers) >= 4 * NUMBER
    for start in range(0, len(layers), 500):
        check_schema("--builtin-schema", "vendor.compose-spec", *layers[start : start + 500])


def test_compose_accepts_it(generated: Path) -> None:
    for folder in first_instances(generated):
        result = subprocess.run([*compose(), "config", "-q"], cwd=folder, capture_output=True, text=True, check=False)
        assert (result.returncode, result.stderr) == (0, ""), folder.name


@pytest.mark.proof
def test_an_installed_wheel_gives_the_same_bytes(generated: Path, tmp_path: Path) -> None:
    wheel, site = tmp_path / "wheel", tmp_path / "site"
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel", "--no-deps", "--wheel-dir", str(wheel), str(ROOT)], check=True)
    subprocess.run([*pip, "install", "--no-deps", "--target", str(site), *map(str, wheel.glob("*.whl"))], check=True)
    folder = tmp_path / "elsewhere"
    shutil.copytree(generated.parent, folder, ignore=shutil.ignore_patterns("generated"))
    environment = {**os.environ, "PYTHONPATH": str(site), "PYTHONHASHSEED": "7"}
    where = [sys.executable, "-c", "import dodo_dsl; print(dodo_dsl.__file__)"]
    found = subprocess.run(where, cwd=folder, env=environment, capture_output=True, text=True, check=True).stdout
    assert found.startswith(str(site))
    subprocess.run([sys.executable, "-m", "dodo_dsl", "compile"], cwd=folder, env=environment, check=True)
    assert tree(folder / "generated") == tree(generated)
