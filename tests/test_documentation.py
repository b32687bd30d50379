"""What the documentation shows is true: its specs compile, its commands exist, its examples run."""

import json
import re
import shutil
from io import StringIO
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator

from dodo_dsl.cli.main import main
from dodo_dsl.report.trajectory import read_ground
from dodo_dsl.source import parse
from dodo_dsl.spec.validation import validate
from services.base.flags import load_manifest, parser

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
CONTRACT = (ROOT / "docs/reference/applications.md").read_text()
YAML_BLOCK = re.compile(r"```yaml\n(.*?)```", re.DOTALL)
PERCEPTIONS = ("sil-empty-pictures", "sil-perception", "sil-perception-cars")


def block(word: str, page: str = README) -> str:
    (found,) = [b for b in YAML_BLOCK.findall(page) if word in b]
    return str(found)


PROGRAM = re.search(r"```python\n(.*?)```", CONTRACT, re.DOTALL)[1]  # type: ignore[index]
SPEC = "tests/sil-my-straight/sil-my-straight.dodo.yml"


@pytest.fixture
def newcomer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository made of the README's test and the application of its page, word for word."""
    assert SPEC in README
    (tmp_path / SPEC).parent.mkdir(parents=True)
    (tmp_path / SPEC).write_text(block("evaluation:"))
    shutil.copytree(ROOT / "tests_registry" / "maps" / "straight", tmp_path / "tests" / "maps" / "straight")
    (tmp_path / "docker-compose.yml").write_text(block("team/steering:latest", CONTRACT))
    (tmp_path / "dodo.yml").write_text(block("registry:", CONTRACT))
    (tmp_path / "steering.py").write_text(PROGRAM)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    return tmp_path


def dodo(*words: str) -> tuple[int, str]:
    stdout = StringIO()
    return main(words, stdout, stdout), stdout.getvalue()


def test_the_message_in_the_readme_is_what_dodo_says(newcomer: Path) -> None:
    (newcomer / SPEC).write_text(block("evaluation:").replace("freq: 10 Hz", "freq: 10"))
    (newcomer / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\n")
    (shown,) = re.findall(r"\n    \$ dodo compile --check\n((?:    .*\n)+)", README)
    stdout = StringIO()
    assert main(["compile", "--check"], stdout, stdout) == 2
    assert stdout.getvalue().splitlines() == [line.removeprefix("    ") for line in shown.splitlines()]


def test_the_blocks_of_readme_and_contract_compile_together(newcomer: Path) -> None:
    """Shipped tests that its application cannot feed are left out, and said; they are nobody's mistake."""
    stdout, stderr = StringIO(), StringIO()
    assert main(["compile"], stdout, stderr) == 0, stdout.getvalue() + stderr.getvalue()
    unfed = ["dil-static-rig", "hil-camera", "hil-camera-scenes", "hil-perception", *PERCEPTIONS]
    assert (
        f"skipped shipped tests that do not fit what the application sends and takes: {', '.join(unfed)} (see"
        in stdout.getvalue()
    )
    compiled = {path.parent.name.partition("--")[0] for path in newcomer.glob("generated/*/test.json")}
    shipped = {path.parent.name for path in (ROOT / "tests_registry").glob("*/*.dodo.yml")}
    assert compiled == {"sil-my-straight", *shipped} - {*unfed}


def test_a_shipped_test_that_is_named_is_an_error(newcomer: Path) -> None:
    stdout = StringIO()
    assert main(["compile", "--check", "sil-perception"], stdout, StringIO()) == 2
    assert "error[no-sample]: 'cones' needs opendlv.logic.perception.DetectionBoundingBox/0" in stdout.getvalue()
    assert "left out" not in stdout.getvalue()


def test_ones_own_test_is_never_left_out(newcomer: Path) -> None:
    compose = newcomer / "docker-compose.yml"
    compose.write_text(compose.read_text().replace("opendlv.proxy.GroundSteeringRequest, ", ""))
    stdout = StringIO()
    assert main(["compile", "--check"], stdout, StringIO()) == 2
    assert f"{SPEC}:16:3: error[no-producer]: 'vehicle' needs opendlv.proxy.GroundSteeringRequest" in stdout.getvalue()
    assert "tests_registry" not in stdout.getvalue()
    assert "sil-closed-straight" in stdout.getvalue().splitlines()[0]


def test_the_test_of_a_recording_with_a_table_in_seconds_checks(newcomer: Path) -> None:
    """The page's test has no problem; without the sample times of the test, it has one."""
    text = block("dil-by-hand", (ROOT / "docs/how-to/recordings.md").read_text())
    for folder in ("dil-by-hand", "recordings", "targets"):
        (newcomer / "tests" / folder).mkdir()
    shutil.copy(ROOT / "tests_registry/recordings/kiwi-track.rec", newcomer / "tests/recordings/drive.rec")
    (newcomer / "tests/targets/by-hand.csv").write_text("time,value\n0,0\n9,0.2\n")
    for written, code in ((text, 0), (text.replace(", sample-times: test", ""), 2)):
        (newcomer / "tests/dil-by-hand/dil-by-hand.dodo.yml").write_text(written)
        stdout = StringIO()
        assert main(["compile", "--check", "dil-by-hand"], stdout, stdout) == code, stdout.getvalue()
    assert "hint: write 'sample-times: test' under 'with' of 'drive'" in stdout.getvalue()


@pytest.mark.slow
def test_the_application_of_the_page_passes_the_test_of_the_readme(newcomer: Path) -> None:
    code, output = dodo("run", "sil-my-straight", "--clock", "lockstep")
    assert code == 0, output
    assert re.search(r"^PASSED  sil-my-straight +[0-9.]+ s .* wall-margin 0", output, re.MULTILINE), output


@pytest.mark.slow
def test_a_blind_application_fails_the_test_that_dodo_new_writes(newcomer: Path) -> None:
    """Who goes straight ahead, without a look, is told so by the very first test."""
    (newcomer / "steering.py").write_text(PROGRAM.replace("-(left + right)", "0.0"))
    assert dodo("new", "sil-first")[0] == 0
    code, output = dodo("run", "sil-first", "--clock", "lockstep")
    assert code == 1, output
    assert "FAILED  sil-first  hit wall right after " in output


MANIFESTS = sorted(p.parent for p in (ROOT / "services").glob("*/service.yml"))


@pytest.mark.parametrize("folder", MANIFESTS, ids=lambda p: p.name)
def test_services_help_ends_with_an_example(folder: Path) -> None:
    manifest = yaml.safe_load((folder / "service.yml").read_text())
    shown = parser(load_manifest(folder)).format_help()
    for parameter in manifest["parameters"]:
        assert f"--{parameter}" in shown
    assert f"example: {' '.join(manifest['process'])} " in " ".join(shown.split())
    assert (folder / "README.md").is_file()


def test_the_map_of_the_page_is_one(tmp_path: Path) -> None:
    """Its obstacles and instances are what report and services read."""
    (text,) = re.findall(r"```json\n(.*?)```", (ROOT / "docs" / "reference" / "maps.md").read_text(), re.DOTALL)
    (tmp_path / "map.json").write_text(text)
    (tmp_path / "cone.obj").touch()
    ground = read_ground(tmp_path)
    assert [name for name, _ in ground.lines] == ["left", "right", "behind", "beyond", "finish"]
    assert [len(points) for _, points in ground.models] == [2]


def test_the_page_of_services_has_a_table_of_them() -> None:
    manifests = [(folder, yaml.safe_load((folder / "service.yml").read_text())) for folder in MANIFESTS]
    rows = [
        f"| [{about['name']}](../../services/{folder.name}/README.md)"
        f" | {', '.join(about['layers'])} | {about['description']} |"
        for folder, about in manifests
        if not about.get("automatic")
    ]
    assert "\n".join(["|---|---|---|", *rows, ""]) in (ROOT / "docs/reference/services.md").read_text()


def test_the_page_has_every_key_that_a_service_may_have_for_dodo() -> None:
    """Its table names those of the schema, each with an example that the schema takes."""
    rows = re.findall(r"^\| `(x-dodo[\w-]*)(?:: (\w+))?` \| .+ \| .+ \| `(.+)` \|$", CONTRACT, re.MULTILINE)
    schema = json.loads((ROOT / "schemas/application.schema.json").read_text())
    keys = {key: node for key, node in schema["$defs"]["service"]["properties"].items() if key.startswith("x-dodo")}
    own = keys.pop("x-dodo")["properties"]
    assert {(key, part) for key, part, _ in rows} == {("x-dodo", part) for part in own} | {(key, "") for key in keys}
    for key, part, example in rows:
        value = yaml.safe_load(example)
        service = {"image": "example", key: {part: value} if part else value}
        Draft202012Validator(schema).validate({"services": {"app": service}})


SCHEMAS = {
    "machine": {"leases"},
    "dodo": {"environment", "action", "evaluation"},
    "deployment": {"registry", "rigs", "application", "sandbox"},
    "application": {"services"},
    "service": {"layers"},
}
"""By the keys of an example, the first that fits."""


def schema_of(text: str) -> str:
    node = yaml.safe_load(text)
    return next((name for name, keys in SCHEMAS.items() if isinstance(node, dict) and keys & node.keys()), "")


EXAMPLES = [
    pytest.param(schema, text, id=f"{page.stem}-{number}")
    for page in sorted((ROOT / "docs").rglob("*.md"))
    if page.name != "rules.md"  # whose examples are wrong
    for number, text in enumerate(YAML_BLOCK.findall(page.read_text()))
    if "\n    ..." not in text and (schema := schema_of(text))
]


@pytest.mark.parametrize(("schema", "text"), EXAMPLES)
def test_examples_are_valid_as_far_as_they_go(schema: str, text: str) -> None:
    """What a page leaves out may be missing; whole tests drive in ``contributing/test_tutorial.py``."""
    node, problems = parse(text, "example.yml")
    assert node is not None
    found = [*problems, *(one for one in validate(node, schema) if one.rule != "missing-key")]
    assert found == []
