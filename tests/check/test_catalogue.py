"""The rule catalogue: it has every rule that code can give and no other, and its examples are true."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from dodo_dsl.check import catalogue
from tests.check import examples

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "dodo_dsl"
PAGE = ROOT / "docs" / "reference" / "rules.md"
RULES = sorted(catalogue.pages())
EXAMPLES = [pytest.param(r, marks=[pytest.mark.slow] if r == "pipeline-limit" else []) for r in RULES]
"""All rules, of which one has an example with hundreds of instances."""


@pytest.mark.parametrize("rule", EXAMPLES)
def test_the_bad_example_gives_its_rule(rule: str, tmp_path: Path) -> None:
    page = catalogue.pages()[rule]
    examples.write(page.bad, tmp_path, page.encoding)
    assert rule in {problem.rule for problem in examples.problems(tmp_path)}


@pytest.mark.thorough
@pytest.mark.parametrize("rule", [rule for rule in EXAMPLES if catalogue.pages()[str(rule.values[0])].instead])
def test_the_good_example_is_silent(rule: str, tmp_path: Path) -> None:
    examples.write(catalogue.pages()[rule].good, tmp_path)
    assert examples.problems(tmp_path) == []


def test_the_page_is_up_to_date(update_goldens: bool) -> None:
    if update_goldens:
        catalogue.write(PAGE)
    assert PAGE.read_text() == catalogue.markdown(), "scripts/make-rules brings it up to date"


@pytest.mark.thorough
def test_the_catalogue_has_what_code_can_give() -> None:
    assert sorted(set(given_rules())) == RULES


def given_rules() -> Iterator[str]:
    """The rule of every diagnostic that any module makes: the literals that reach a parameter called ``rule``."""
    texts = {path: path.read_text() for path in PACKAGE.rglob("*.py")}
    trees = {path: ast.parse(text) for path, text in texts.items() if "Diagnostic" in text}
    takers = {name: place for tree in trees.values() for name, place in _takers(tree)}
    for path, tree in trees.items():
        for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
            name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
            if name in takers:
                yield from _literals(_argument(call, takers[name]), tree, f"{path.name}:{call.lineno}")


def _takers(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Functions and classes with a parameter ``rule``, and its place among their arguments."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            fields = [n.target.id for n in node.body if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)]
            made = [n for n in node.body if isinstance(n, ast.FunctionDef) and n.name == "__init__"]
            names = [a.arg for a in made[0].args.args[1:]] if made else fields
        elif isinstance(node, ast.FunctionDef) and node.name != "__init__":
            names = [a.arg for a in node.args.args if a.arg != "self"]
        else:
            continue
        if "rule" in names:
            yield node.name, names.index("rule")


def _argument(call: ast.Call, place: int) -> ast.expr | None:
    named = [k.value for k in call.keywords if k.arg == "rule"]
    return named[0] if named else call.args[place] if place < len(call.args) else None


def _literals(value: ast.expr | None, tree: ast.AST, where: str) -> Iterator[str]:
    if isinstance(value, ast.Constant):
        yield str(value.value)
    elif isinstance(value, ast.IfExp):
        yield from _literals(value.body, tree, where)
        yield from _literals(value.orelse, tree, where)
    elif isinstance(value, ast.Name):
        assigned = [n.value for n in ast.walk(tree) if isinstance(n, ast.Assign) and _names(n) == [value.id]]
        assert assigned or value.id == "rule", f"{where}: the rule '{value.id}' is unknown"
        for one in assigned:
            yield from _literals(one, tree, where)
    else:
        pytest.fail(f"{where}: write the rule's name out, so that the catalogue can be compared")


def _names(node: ast.Assign) -> list[str]:
    return [target.id for target in node.targets if isinstance(target, ast.Name)]
