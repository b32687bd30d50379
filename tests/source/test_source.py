"""YAML with positions: values of the core schema, places as an editor counts them, bounded on hostile input."""

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.diagnostics import Span
from dodo_dsl.source import MAX_DEPTH, Mapping, Sequence, parse, plain, read, resolve


def parsed(text: str) -> object:
    node, problems = parse(text, "x.yml")
    assert problems == []
    assert node is not None
    return plain(node)


def rules(text: str) -> list[str]:
    return [d.rule for d in parse(text, "x.yml")[1]]


def test_scalars_follow_yaml_1_2() -> None:
    text = "[1, -7, 0x1F, 0o17, 1.5, 1e3, true, True, ~, null, on, yes, 12:30, '1', 10 Hz]"
    assert parsed(text) == [1, -7, 31, 15, 1.5, 1000.0, True, True, None, None, "on", "yes", "12:30", "1", "10 Hz"]


def test_positions_count_from_one() -> None:
    node, _ = parse("a: 1\nbee: {c: [x, yy]}\n", "x.yml")
    assert isinstance(node, Mapping)
    entry = node.entries["bee"]
    assert entry.key == Span("x.yml", 2, 1, 3)
    inner = entry.value
    assert isinstance(inner, Mapping)
    items = inner.entries["c"].value
    assert isinstance(items, Sequence)
    assert [i.span for i in items.items] == [Span("x.yml", 2, 11, 1), Span("x.yml", 2, 14, 2)]


def test_anchors_and_merges() -> None:
    text = "base: &b {x: 1, y: 2}\nuse: {<<: *b, y: 3}\nboth: {<<: [*b, {z: 9}], x: 0}\nagain: *b\n"
    assert parsed(text) == {
        "base": {"x": 1, "y": 2},
        "use": {"x": 1, "y": 3},
        "both": {"x": 0, "y": 2, "z": 9},
        "again": {"x": 1, "y": 2},
    }


def test_deep_nesting_within_the_limit_is_read() -> None:
    assert parsed("[" * MAX_DEPTH + "]" * MAX_DEPTH) is not None


def test_unreadable_files_are_diagnostics(tmp_path) -> None:  # type: ignore[no-untyped-def]
    assert [d.rule for d in read(tmp_path / "none.yml")[1]] == ["unreadable-file"]
    assert [d.rule for d in read(tmp_path)[1]] == ["unreadable-file"]
    big = tmp_path / "big.yml"
    big.write_text("a: " + "x" * (1 << 20))
    assert [d.rule for d in read(big)[1]] == ["too-large"]


@given(st.text(max_size=200))
def test_any_text_is_read_or_diagnosed(text: str) -> None:
    node, problems = parse(text, "x.yml")
    assert all(d.span.line >= 1 and d.span.column >= 1 for d in problems)
    if node is not None:
        plain(node)


_leaves = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=8)
_keys = st.text(st.characters(codec="ascii", categories=["L"]), min_size=1, max_size=6)
_trees = st.recursive(_leaves, lambda t: st.lists(t, max_size=3) | st.dictionaries(_keys, t, max_size=3), max_leaves=12)


@given(_trees)
@pytest.mark.thorough
def test_reads_what_pyyaml_writes_in_quotes(tree: object) -> None:
    """JSON is YAML: what stands in quotes and plain JSON numbers comes back as it was."""
    text = yaml.safe_dump(tree, default_style=None, default_flow_style=True, allow_unicode=False)
    node, problems = parse(text, "x.yml")
    assert problems == []
    assert node is not None
    assert _comparable(plain(node)) == _comparable(yaml.safe_load(text))


def _comparable(value: object) -> object:
    """PyYAML reads YAML 1.1: what the two versions resolve differently is compared as text."""
    if isinstance(value, dict):
        return {str(k): _comparable(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_comparable(v) for v in value]
    return resolve(value) if isinstance(value, str) and resolve(value) != value else value
