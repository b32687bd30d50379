"""Strange texts and structures in process: values reach the flag as they are written, mistakes give sentences."""

import itertools
import json
import os
import shlex
import shutil
import subprocess
from io import StringIO
from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dodo_dsl.cli.main import main
from dodo_dsl.spec.model import MAX_SERVICES
from tests.compiler import examples
from tests.compiler.test_output import compose

MANIFEST = """\
name: judge
layers: [evaluation]
image: judge
process: [python, -m, judge]
description: Judges.
parameters: {text: {type: string, default: "", help: A text.}, texts: {type: list, default: [], help: Texts.}}
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
quick = settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    examples.write(f"# dodo.yml\nservices: [own]\n# own/judge/service.yml\n{MANIFEST}", tmp_path)
    shutil.rmtree(tmp_path / "tests" / "base")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def compiled(folder: Path, spec: str) -> tuple[int, str]:
    """The exit code and what was said; nothing but the output may be new."""
    (folder / examples.EXAMPLE).write_text(spec, encoding="utf-8")
    before = {p for p in folder.rglob("*") if "generated" not in p.parts}
    stdout, stderr = StringIO(), StringIO()
    code = main(["compile"], stdout, stderr)
    text = stdout.getvalue() + stderr.getvalue()
    assert code in (0, 2), text
    assert {p for p in folder.rglob("*") if "generated" not in p.parts} == before
    return code, text


def judged(**parameters: object) -> str:
    """A test whose evaluator is given these values; JSON is YAML."""
    use = {"text": {"uses": "judge", "with": parameters}}
    return examples.SPEC.split("evaluation:")[0] + "evaluation: " + json.dumps(use, ensure_ascii=False) + "\n"


def flags(folder: Path) -> dict[str, str]:
    plan = json.loads((folder / "generated/example/test.json").read_text(encoding="utf-8"))
    (judge,) = [s for s in plan["services"] if s["name"] == "text"]
    return {flag["name"]: flag["value"] for flag in judge["flags"]}


def command(folder: Path) -> list[str]:
    layers = yaml.safe_load((folder / "generated/example/evaluation.compose.yml").read_text(encoding="utf-8"))
    return [str(word).replace("$$", "$") for word in layers["services"]["text"]["command"]]


@pytest.mark.parametrize("text", TEXTS)
def test_a_text_reaches_its_flag(folder: Path, text: str) -> None:
    assert compiled(folder, judged(text=text, texts=[text.replace(",", ""), "x"]))[0] == 0
    assert flags(folder)["text"] == text
    assert flags(folder)["texts"] == text.replace(",", "") + ",x"
    assert command(folder)[:2] == [f"--text={text}", f"--texts={text.replace(',', '')},x"]


@quick
@given(
    text=st.text(st.characters(exclude_categories=["C", "Zl", "Zp", "Zs"], include_characters=" "), max_size=40).filter(
        lambda t: "${" not in t
    )
)
def test_any_printable_text_reaches_its_flag(folder: Path, text: str) -> None:
    assert compiled(folder, judged(text=text))[0] == 0
    assert flags(folder)["text"] == text
    assert command(folder)[0] == f"--text={text}"


def test_compose_reads_the_same(folder: Path) -> None:
    """``docker compose config`` writes a dollar as two, as a compose file has it."""
    assert compiled(folder, judged(texts=[text.replace(",", "") for text in TEXTS]))[0] == 0
    layers = [f"--file={path.name}" for path in Path("generated/example").glob("*.compose.yml")]
    command = [*compose(), *layers, "config", "--format", "json"]
    result = subprocess.run(command, cwd="generated/example", capture_output=True, text=True, check=True)
    words = json.loads(result.stdout)["services"]["text"]["command"]
    assert f"--texts={','.join(text.replace(',', '') for text in TEXTS)}" in [word.replace("$$", "$") for word in words]


def test_values_of_a_matrix_are_words_of_the_shell_only_in_quotes(folder: Path) -> None:
    values = [f"a{n}{text}" for n, text in enumerate(TEXTS)]
    spec = judged(text="${matrix.text}") + "matrix: " + json.dumps({"text": values}, ensure_ascii=False) + "\n"
    assert compiled(folder, spec)[0] == 0
    plans = [json.loads(path.read_text(encoding="utf-8")) for path in Path("generated").glob("*/test.json")]
    assert {
        flag["value"] for p in plans for s in p["services"] for flag in s["flags"] if flag["name"] == "text"
    } == set(values)
    child = yaml.safe_load(Path("generated/child.gitlab-ci.yml").read_text(encoding="utf-8"))
    folders = {shlex.split(job["script"][0])[3] for name, job in child.items() if name.startswith("example--")}
    assert folders == {f"generated/{plan['slug']}" for plan in plans}


@pytest.mark.parametrize("text", ["a\nb", "a\x1b[2J", "a\0b", "a\u2028b", "a\u202eb", "x" * 5000])
def test_what_no_flag_carries_is_refused(folder: Path, text: str) -> None:
    code, said = compiled(folder, judged(text=text))
    assert (code, "[wrong-value]" in said) == (2, True)
    assert "\x1b" not in said
    assert "\0" not in said


MANY = "".join(f"  s{i}: {{uses: integrator}}\n" for i in range(5000))
SPECS = {
    "many services": examples.SPEC.replace("action:\n", "action:\n" + MANY),
    "many items": examples.SPEC.replace("goal: finish", f"walls: [{'x,' * 15_000}]"),
    "many dimensions": examples.SPEC + "matrix:\n" + "".join(f"  a{i}: [1]\n" for i in range(5000)),
    "many keys": examples.SPEC + "".join(f"k{i}: 1\n" for i in range(9000)),
    "many repeated keys": "a: 1\n" * 20_000,
    "many tabs": "a:\n" + "\tb: 1\n" * 100_000,
    "a long number": examples.SPEC.replace("60 s", "9" * 900_000 + " s"),
    "a large seed": examples.SPEC + "seed: " + "9" * 900_000,
    "an infinite seed": examples.SPEC + "seed: .inf\n",
    "no seed": examples.SPEC + "seed: .nan\n",
    "a long text": examples.SPEC.replace("finish}", "x" * 900_000 + "}"),
    "deep": "{a: " * 200_000,
    "merges": "a: &a {x: 1}\nb:\n" + "  <<: *a\n" * 20_000,
    "NUL in a path": 'extends: "a\\0b"\nname: example\n',
    "a long path": f'extends: "{"a/" * 5000}"\nname: example\n',
    "a circle of links": "extends: ../loop\nname: example\n",
    "a pipe to extend": "extends: ../pipe\nname: example\n",
    "a circle of files": examples.SPEC.replace("../maps/plain", "../loop"),
    "a pipe for a map": examples.SPEC.replace("../maps/plain", "../pipe"),
}  # fmt: skip


@pytest.mark.parametrize("case", SPECS)
def test_a_hostile_spec_gives_few_sentences(folder: Path, case: str) -> None:
    (folder / "tests" / "loop").symlink_to("loop")
    os.mkfifo(folder / "tests" / "pipe")
    code, said = compiled(folder, SPECS[case])
    assert code == 2
    assert ": error[" in said
    assert len(said) < 1 << 20


def test_no_service_is_left_out_silently(folder: Path) -> None:
    """The schema's limit is where the compiler stops to read."""
    extra = "".join(f"  s{i}: {{uses: dynamic-model, with: {{frame-id: {i + 1}}}}}\n" for i in range(MAX_SERVICES - 2))
    full = examples.SPEC.replace("action:\n", "action:\n" + extra)
    assert compiled(folder, full)[0] == 0
    code, said = compiled(
        folder, full.replace("  pose:", "  more: {uses: dynamic-model, with: {frame-id: 999}}\n  pose:")
    )
    assert (code, "[too-large]" in said) == (2, True)


@pytest.mark.parametrize("key", ["registry", "services", "messages", "application"])
@pytest.mark.parametrize("path", ["a\0b", "a" * 5000, "loop", "pipe", "/dev/zero", "../" * 200 + "none"])
def test_paths_of_a_deployment(folder: Path, key: str, path: str) -> None:
    (folder / "loop").symlink_to("loop")
    os.mkfifo(folder / "pipe")
    deployment = {"dodo": 1, "registry": ["tests"], "application": "docker-compose.yml", key: [path]}
    (folder / "dodo.yml").write_text(json.dumps(deployment))
    code, said = compiled(folder, examples.SPEC)
    assert (code, "dodo.yml:1:" in said, "[missing-file]" in said) == (2, True, True)


NAMES = st.sampled_from(["dodo", "name", "level", "extends", "matrix", "with", "uses", "action", "camera", "<<", "a b"])
SCALARS = st.sampled_from(
    ["1", "sil", "hil", "60 s", "~", "*a", "&a x", "!!set", "|", "'", '"', "${matrix.a}", "../x", "\t"]
)
LINES = st.builds(lambda n, k, v: "  " * n + f"{k}: {v}\n", st.integers(0, 4), NAMES, SCALARS | st.text(max_size=8))


@quick
@given(lines=st.lists(LINES, max_size=12))
def test_lines_like_yaml(folder: Path, lines: list[str]) -> None:
    spec = "".join(lines).encode("utf-8", "replace").decode()
    assert compiled(folder, spec) == compiled(folder, spec)


@quick
@given(data=st.data())
def test_mutations_of_a_good_spec(folder: Path, data: st.DataObject) -> None:
    """Characters are cut out, put in or doubled."""
    spec = judged(text="x") + "matrix: {a: [1, 2]}\nrecord: {frames: 1 Hz}\n"
    for _ in range(data.draw(st.integers(1, 3))):
        begin = data.draw(st.integers(0, len(spec)))
        end = data.draw(st.integers(begin, min(len(spec), begin + 30)))
        put = data.draw(
            st.sampled_from(["", "\n", ": ", "{", "]", "- ", "&a ", "*a", "${matrix.a}", spec[begin:end] * 2])
        )
        spec = spec[:begin] + put + spec[end:]
    compiled(folder, spec)  # which says what it takes the place of
    first = compiled(folder, spec)
    assert compiled(folder, spec) == first


def test_every_pair_of_layers_may_be_swapped(folder: Path) -> None:
    """A value of each key in the place of each other one."""
    spec = yaml.safe_load(examples.SPEC)
    for one, other in itertools.permutations(spec, 2):
        compiled(folder, json.dumps({**spec, one: spec[other]}))
