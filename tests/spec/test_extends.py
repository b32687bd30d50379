"""Specs over the specs that they extend."""

from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.source import plain, read
from dodo_dsl.spec.load import MAX_CHAIN, resolve

BASE = "name: base\nlevel: sil\nmatrix: {a: [1, 2]}\naction: {car: {uses: model, with: {x: 1 m, y: 2 m}}}\n"


def resolved(folder: Path, text: str, **others: str) -> tuple[Any, list[tuple[str, str]]]:
    """A spec in a registry, beside others by the names of their files."""
    for name, content in {"own": text, "base": BASE, **others}.items():
        (folder / f"{name}.dodo.yml").write_text(content)
    node, _ = read(folder / "own.dodo.yml")
    assert node is not None
    found, problems = resolve(node, folder / "own.dodo.yml", folder)
    return plain(found), [(problem.rule, problem.message) for problem in problems]


def test_mappings_merge_and_values_replace(tmp_path: Path) -> None:
    own = "extends: base.dodo.yml\nname: own\nmatrix: {a: [3]}\naction: {car: {with: {x: 5 m}}}\n"
    expected = {
        "level": "sil",
        "matrix": {"a": [3]},
        "action": {"car": {"uses": "model", "with": {"x": "5 m", "y": "2 m"}}},
        "name": "own",
    }
    assert resolved(tmp_path, own) == (expected, [])


def test_null_removes(tmp_path: Path) -> None:
    own, problems = resolved(tmp_path, "extends: base.dodo.yml\nmatrix:\naction: {car: {with: {y: }}}\n")
    assert own == {"level": "sil", "action": {"car": {"uses": "model", "with": {"x": "1 m"}}}}
    assert problems == []


def test_another_service_starts_without_the_parameters(tmp_path: Path) -> None:
    own, _ = resolved(tmp_path, "extends: base.dodo.yml\naction: {car: {uses: other, with: {z: 1}}}\n")
    assert own["action"] == {"car": {"uses": "other", "with": {"z": 1}}}
    own, _ = resolved(tmp_path, "extends: base.dodo.yml\naction: {car: {uses: model}}\n")
    assert own["action"]["car"]["with"] == {"x": "1 m", "y": "2 m"}


def test_a_long_chain(tmp_path: Path) -> None:
    chain = {f"t{n}": f"extends: t{n + 1}.dodo.yml\n" for n in range(MAX_CHAIN + 1)}
    _, problems = resolved(tmp_path, "extends: t0.dodo.yml\n", **chain)
    assert problems == [("extends-cycle", f"the chain of extended tests is longer than {MAX_CHAIN}")]


@pytest.mark.parametrize(
    ("written", "hint"),
    [
        ("first", "did you mean '../first/first.dodo.yml'?"),
        ("../frist/first.dodo.yml", "did you mean '../first/first.dodo.yml'?"),
        ("dodo:first", "'dodo new NAME --extends TEST' copies a test that ships with DoDo"),
        ("../first/frist.dodo.yml", "did you mean '../first/first.dodo.yml'?"),
    ],
)
def test_hints_for_what_is_not_there(written: str, hint: str, tmp_path: Path) -> None:
    for name, text in (("first", BASE), ("own", f"extends: {written}\n")):
        (tmp_path / name).mkdir()
        (tmp_path / name / f"{name}.dodo.yml").write_text(text)
    file = tmp_path / "own" / "own.dodo.yml"
    node, _ = read(file)
    assert node is not None
    (problem,) = resolve(node, file, tmp_path)[1]
    assert problem.hint.endswith(hint)
