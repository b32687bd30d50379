"""Specs of any content: the compiler reports problems, in few words and always the same."""

import copy
import os
from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dodo_dsl.diagnostics import format_text, has_errors
from tests.check import examples

GOOD = yaml.safe_load(examples.SPEC)
quick = settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    examples.write("", tmp_path)
    (tmp_path / "tests/base/base.dodo.yml").unlink()
    return tmp_path


def refused(folder: Path, spec: str) -> bool:
    """Whether the spec has errors; the text about it is short and printable."""
    (folder / examples.EXAMPLE).write_text(spec, encoding="utf-8")
    found, files = examples.compiled(folder)
    text = format_text(found)
    assert len(text) < 1 << 20
    assert all(character.isprintable() or character == "\n" for character in text)
    assert has_errors(found) != bool(files)
    return has_errors(found)


MANY = "".join(f"  s{i}: {{uses: integrator}}\n" for i in range(2000))
SPECS = {
    "many services": examples.SPEC.replace("action:\n", "action:\n" + MANY),
    "many items": examples.SPEC.replace("goal: finish", f"walls: [{'x,' * 15_000}]"),
    "many dimensions": examples.SPEC + "matrix:\n" + "".join(f"  a{i}: [1]\n" for i in range(1000)),
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
    "a symlink loop": "extends: ../loop\nname: example\n",
    "a pipe to extend": "extends: ../pipe\nname: example\n",
    "a symlink loop for a map": examples.SPEC.replace("../maps/plain", "../loop"),
    "a pipe for a map": examples.SPEC.replace("../maps/plain", "../pipe"),
}  # fmt: skip


@pytest.mark.thorough
@pytest.mark.parametrize("case", SPECS)
def test_hostile_specs_are_refused(folder: Path, case: str) -> None:
    (folder / "tests" / "loop").symlink_to("loop")
    os.mkfifo(folder / "tests" / "pipe")
    assert refused(folder, SPECS[case])


@pytest.mark.slow
@quick
@given(data=st.data())
def test_mutations_of_a_good_spec(folder: Path, data: st.DataObject) -> None:
    """Characters are cut out, put in or doubled."""
    spec = examples.SPEC + "matrix: {a: [1, 2]}\nrecord: {frames: 1 Hz}\n"
    for _ in range(data.draw(st.integers(1, 3))):
        begin = data.draw(st.integers(0, len(spec)))
        end = data.draw(st.integers(begin, min(len(spec), begin + 30)))
        put = data.draw(
            st.sampled_from(["", "\n", ": ", "{", "]", "- ", "&a ", "*a", "${matrix.a}", spec[begin:end] * 2])
        )
        spec = spec[:begin] + put + spec[end:]
    refused(folder, spec)
    assert examples.compiled(folder) == examples.compiled(folder)


ODD = st.recursive(
    st.none() | st.booleans() | st.integers(-2, 300) | st.floats() | st.text(max_size=6) | st.just("${matrix.a}"),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=4) | st.integers(), inner, max_size=2),
    max_leaves=4,
)


@pytest.mark.slow
@quick
@given(st.data())
def test_odd_values(folder: Path, data: st.DataObject) -> None:
    """A value at any place of a good spec is replaced."""
    spec = copy.deepcopy(GOOD)
    node = spec
    while True:
        key = data.draw(st.sampled_from(sorted(node)))
        if not (isinstance(node[key], dict) and node[key] and data.draw(st.booleans())):
            break
        node = node[key]
    node[key] = data.draw(ODD)
    refused(folder, yaml.safe_dump(spec))
