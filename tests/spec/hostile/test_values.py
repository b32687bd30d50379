"""Strange strings: values reach the flag as they are written, and what no flag carries is refused."""

import json
import os
import shlex
import subprocess
from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dodo_dsl.diagnostics import format_text, has_errors
from dodo_dsl.spec.deployment import load_deployment
from tests.check import examples
from tests.emit.readers import compose

MANIFEST = """\
name: judge
layers: [evaluation]
image: judge
process: [python, -m, judge]
description: Judges.
parameters: {text: {type: string, default: "", help: A string.}, texts: {type: list, default: [], help: Strings.}}
"""
TEXTS = [
    "$(touch pwned) `touch pwned`; touch pwned & | > < \\",
    "${HOME} $HOME $$ ${a:-b} %s %(x)s",
    "{{ 7 * 7 }} {% for x in y %} {# no #} {{ cycler.__init__.__globals__ }}",
    "' \" ''' \"\"\" # not a comment",
    "--help",
    "- a: &b !!python/object *c",
    "null",
    "~",
    "0x10",
    "1e3",
    "::error::no %0A",
    "\U0001f697, \u00e9, \u05d0",
]
MAX_SERVICES = 100
quick = settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A deployment with an evaluator of its own; each test writes the spec."""
    path = tmp_path_factory.mktemp("values")
    examples.write(f"# dodo.yml\nservices: [own]\n# own/judge/service.yml\n{MANIFEST}", path)
    (path / "tests/base/base.dodo.yml").unlink()
    return path


def compiled(folder: Path, spec: str) -> dict[str, str]:
    """The compiled files of a spec without errors."""
    (folder / examples.EXAMPLE).write_text(spec, encoding="utf-8")
    problems, files = examples.compiled(folder)
    assert not has_errors(problems), format_text(problems)
    return {file.path: file.text for file in files}


def rules(folder: Path, spec: str) -> set[str]:
    """The rules that a spec violates; the text about it is printable."""
    (folder / examples.EXAMPLE).write_text(spec, encoding="utf-8")
    problems = examples.problems(folder)
    assert all(character.isprintable() or character == "\n" for character in format_text(problems))
    return {problem.rule for problem in problems}


def judged(**parameters: object) -> str:
    """A test whose evaluator is given these values; JSON is YAML."""
    use = {"text": {"uses": "judge", "with": parameters}}
    return examples.SPEC.split("evaluation:")[0] + "evaluation: " + json.dumps(use, ensure_ascii=False) + "\n"


def flags(files: dict[str, str], slug: str = "example") -> dict[str, str]:
    services = json.loads(files[f"{slug}/test.json"])["services"]
    (judge,) = [service for service in services if service["name"] == "text"]
    return {flag["name"]: flag["value"] for flag in judge["flags"]}


def command(files: dict[str, str]) -> list[str]:
    layer = yaml.safe_load(files["example/evaluation.compose.yml"])
    return [str(word).replace("$$", "$") for word in layer["services"]["text"]["command"]]


@pytest.mark.parametrize("text", TEXTS)
def test_a_text_reaches_its_flag(folder: Path, text: str) -> None:
    without_comma = text.replace(",", "")
    files = compiled(folder, judged(text=text, texts=[without_comma, "x"]))
    assert flags(files)["text"] == text
    assert flags(files)["texts"] == f"{without_comma},x"
    assert command(files)[:2] == [f"--text={text}", f"--texts={without_comma},x"]


@pytest.mark.slow
@quick
@given(
    text=st.text(st.characters(exclude_categories=["C", "Zl", "Zp", "Zs"], include_characters=" "), max_size=40).filter(
        lambda t: "${" not in t
    )
)
def test_any_printable_text_reaches_its_flag(folder: Path, text: str) -> None:
    files = compiled(folder, judged(text=text))
    assert flags(files)["text"] == text
    assert command(files)[0] == f"--text={text}"


@pytest.mark.slow
def test_compose_reads_the_same(folder: Path) -> None:
    """``docker compose config`` writes a dollar as two, as a compose file has it."""
    texts = ",".join(text.replace(",", "") for text in TEXTS)
    for path, text in compiled(folder, judged(texts=texts.split(","))).items():
        (folder / "generated" / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / "generated" / path).write_text(text, encoding="utf-8")
    place = folder / "generated" / "example"
    layers = [f"--file={path.name}" for path in place.glob("*.compose.yml")]
    config = [*compose(), *layers, "config", "--format", "json"]
    result = subprocess.run(config, cwd=place, capture_output=True, text=True, check=True)
    words = json.loads(result.stdout)["services"]["text"]["command"]
    assert f"--texts={texts}" in [word.replace("$$", "$") for word in words]


def test_values_of_a_matrix_are_words_of_the_shell_only_in_quotes(folder: Path) -> None:
    values = [f"a{n}{text}" for n, text in enumerate(TEXTS)]
    spec = judged(text="${matrix.text}") + "matrix: " + json.dumps({"text": values}, ensure_ascii=False) + "\n"
    files = compiled(folder, spec)
    slugs = {path.partition("/")[0] for path in files if path.endswith("/test.json")}
    assert {flags(files, slug)["text"] for slug in slugs} == set(values)
    child = yaml.safe_load(files["child.gitlab-ci.yml"])
    folders = {shlex.split(job["script"][0])[3] for name, job in child.items() if name.startswith("example--")}
    assert {Path(name).name for name in folders} == slugs


@pytest.mark.parametrize("text", ["a\nb", "a\x1b[2J", "a\0b", "a\u2028b", "a\u202eb", "x" * 5000])
def test_what_no_flag_carries_is_refused(folder: Path, text: str) -> None:
    assert rules(folder, judged(text=text)) == {"wrong-value"}


def test_no_service_is_left_out_silently(folder: Path) -> None:
    """The schema's limit is where the compiler stops to read."""
    extra = "".join(f"  s{i}: {{uses: dynamic-model, with: {{frame-id: {i + 1}}}}}\n" for i in range(MAX_SERVICES - 2))
    full = examples.SPEC.replace("action:\n", "action:\n" + extra)
    assert len(json.loads(compiled(folder, full)["example/test.json"])["services"]) > MAX_SERVICES
    more = full.replace("  pose:", "  more: {uses: dynamic-model, with: {frame-id: 999}}\n  pose:")
    assert "too-large" in rules(folder, more)


@pytest.mark.parametrize("key", ["registry", "services", "messages", "application"])
@pytest.mark.parametrize("path", ["a\0b", "a" * 5000, "loop", "pipe", "/dev/zero", "../" * 200 + "none"])
def test_paths_of_a_deployment(tmp_path: Path, key: str, path: str) -> None:
    (tmp_path / "loop").symlink_to("loop")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "dodo.yml").write_text(json.dumps({"dodo": 1, key: [path]}))
    _, problems = load_deployment(tmp_path / "dodo.yml")
    assert [(problem.rule, problem.span.line) for problem in problems] == [("missing-file", 1)]
