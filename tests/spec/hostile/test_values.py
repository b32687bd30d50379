"""Strange strings: values reach the flag as they are written, and what no flag carries is refused."""

import json
import os
from pathlib import Path

import pytest
import yaml

from dodo_dsl.diagnostics import format_text, has_errors
from dodo_dsl.spec.deployment import load_deployment
from tests.check import examples

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


@pytest.mark.parametrize("text", ["a\nb", "a\x1b[2J", "a\0b", "a\u2028b", "a\u202eb", "x" * 5000])
def test_what_no_flag_carries_is_refused(folder: Path, text: str) -> None:
    assert rules(folder, judged(text=text)) == {"wrong-value"}


@pytest.mark.parametrize("key", ["registry", "services", "messages", "application"])
@pytest.mark.parametrize("path", ["a\0b", "a" * 5000, "loop", "pipe", "/dev/zero", "../" * 200 + "none"])
def test_paths_of_a_deployment(tmp_path: Path, key: str, path: str) -> None:
    (tmp_path / "loop").symlink_to("loop")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "dodo.yml").write_text(json.dumps({"dodo": 1, key: [path]}))
    _, problems = load_deployment(tmp_path / "dodo.yml")
    assert [(problem.rule, problem.span.line) for problem in problems] == [("missing-file", 1)]
