"""Each change of a valid file, and what its schema says of it: rule, place, and what to write instead."""

import random
from typing import Any

import pytest

from dodo_dsl.source import Node, parse, plain
from dodo_dsl.spec.validation import schema_of_keys, valid_part, validate
from tests.source.nodes import mapping

BLOCK = """\
dodo: 1
name: example
description: Drive to the finish line.
level: sil
kind: closed-loop
timeout: 60 s
environment:
  camera:
    uses: virtual-camera
    with:
      map-path: ../maps/plain
      freq: 10 Hz
action:
  vehicle:
    uses: dynamic-model
  pose: {uses: integrator}
evaluation:
  track:
    uses: collision
    with:
      goal: finish
"""
ENTRIES = ", ".join(f"s{n}: {{uses: a}}" for n in range(101))
CHANGES = [
    ("level: sil", "levl: sil", "4:1 unknown-key", "did you mean 'level'?"),
    ("uses: dynamic-model", "freq: 1 Hz", "14:3 missing-key, 15:5 unknown-key", "write 'uses: virtual-camera'"),
    ("pose: {uses: i", "pose: {uses:i", "16:10 unknown-key", "write 'uses: integrator'"),
    ("timeout: 60 s", "seed: one", "1:1 missing-key, 6:7 wrong-type", "write 'timeout: 60 s'"),
    ("kind: closed-loop\n", "", "1:1 missing-key", "write 'kind: closed-loop', or perception, open-loop"),
    ("Drive to the finish line.", "1.0", "3:14 wrong-type", 'write it in quotes: "1.0"'),
    ("Drive to the finish line.", "''", "3:1 missing-key", ""),
    ("Drive to the finish line.", "!!binary abc", "3:14 yaml-tag", "remove the tag, or write a text in quotes"),
    ("timeout: 60 s", "timeout: 60", "6:10 wrong-unit", "write for example '60 s'"),
    ("timeout: 60 s", "timeout: 60 m", "6:10 wrong-unit", "write for example '60 s'"),
    ("level: sil", "level:", "4:1 wrong-value", ""),
    ("level: sil", "level: sill", "4:8 wrong-value", "did you mean 'sil'?"),
    ("dodo: 1", "dodo: 0", "1:7 wrong-value", "write 'dodo: 1'"),
    ("name: example", "name: My Test", "2:7 wrong-value", ""),
    ("name: example", "name: example\nseed: 1.0", "3:7 wrong-type", ""),
    ("name: example", "name: example\nseed: -1", "3:7 out-of-range", ""),
    ("name: example", "name: example\nseed: .inf", "3:7 wrong-type", ""),
    ("name: example", f"name: example\nseed: {'9' * 300}", "3:7 out-of-range", ""),
    ("name: example", "name: example\nresponse: {over: 5 %}", "3:1 missing-key", ""),
    ("name: example", "name: example\nmatrix: {a: x}", "3:13 wrong-type", "write a: [x]"),
    ("name: example", "name: example\nmatrix: {A: [x]}", "3:10 wrong-value", ""),
    ("  track:\n    uses: collision\n    with:\n      goal: finish\n", " {}\n", "17:1 missing-key", ""),
    ("action:\n", f"action: {{{ENTRIES}}}\nactoin:\n", "13:1 too-large, 14:1 unknown-key", ""),
    ("  pose: {uses: integrator}", "  Pose: {uses: integrator}", "16:3 wrong-value", ""),
]


def said(text: str, schema: str = "dodo") -> tuple[str, str]:
    """Places and rules, and the first hint."""
    found = sorted(validate(mapping(text), schema))
    return ", ".join(f"{d.span.line}:{d.span.column} {d.rule}" for d in found), found[0].hint if found else ""


@pytest.mark.parametrize(("old", "new", "expected", "hint"), CHANGES, ids=lambda text: text[:24])
def test_a_change_of_a_valid_test(old: str, new: str, expected: str, hint: str) -> None:
    assert said(BLOCK) == ("", "")
    changed = BLOCK.replace(old, new, 1)
    assert changed != BLOCK
    assert said(changed) == (expected, hint)


MOVED = [
    (10, 12, -2, "10:3 missing-key: indent 'with' if it belongs to what stands above it"),
    (12, 12, -2, "12:5 unknown-key: parameters of a service belong into 'with': {freq: ...}"),
    (8, 12, -2, "8:1 unknown-key: indent it if it belongs to 'environment'"),
    (14, 15, -2, "14:1 unknown-key: indent it if it belongs to 'action'"),
    (13, 16, 2, "13:3 missing-key: begin 'action' in the first column if it is the file's"),
    (17, 21, 2, "17:3 missing-key: begin 'evaluation' in the first column if it is the file's"),
]


@pytest.mark.parametrize(("first", "last", "deep", "expected"), MOVED)
def test_a_hint_says_where_lines_belong_that_are_indented_one_level_off(
    first: int, last: int, deep: int, expected: str
) -> None:
    lines = BLOCK.splitlines()
    for number in range(first - 1, last):
        lines[number] = " " * deep + lines[number] if deep > 0 else lines[number][-deep:]
    found = validate(mapping("\n".join(lines)), "dodo")
    assert expected in [f"{d.span.line}:{d.span.column} {d.rule}: {d.hint}" for d in found]


def test_what_is_not_valid_is_left_out_and_the_rest_stays() -> None:
    text = (
        BLOCK.replace("60 s", "60").replace("{uses: integrator}", "3") + "other: 1\nrecord: {frames: 1, limit: 2 MB}\n"
    )
    node, _, places = valid_part(mapping(text), "dodo")
    assert places == {("timeout",), ("action", "pose"), ("other",), ("record", "frames")}
    expected = plain(mapping(BLOCK.replace("timeout: 60 s\n", "").replace("  pose: {uses: integrator}\n", "")))
    assert node is not None
    assert plain(node) == {**expected, "record": {"limit": "2 MB"}}


VALUES = (
    "",
    "true",
    "12",
    "1.5",
    "x",
    "A b",
    "1 m",
    "5 Hz",
    "[]",
    "[x, x]",
    "{}",
    "{x: }",
    "{uses: x, with: 1}",
    ".nan",
)


@pytest.mark.parametrize("schema", ["dodo", "deployment", "service", "application"])
def test_whatever_stands_at_a_key_the_rest_is_valid(schema: str) -> None:
    chosen, known = random.Random(1), [*schema_of_keys(schema)["properties"], "other"]
    for _ in range(60):
        text = "".join(f"{key}: {chosen.choice(VALUES)}\n" for key in chosen.sample(known, min(3, len(known))))
        node: Node | None = parse(text, "x.yml")[0]
        assert node
        rest, found, _ = valid_part(node, schema)
        again: list[Any] = validate(rest, schema) if rest else []
        assert {d.rule for d in again} <= {"missing-key"}, (text, again)
        assert all(d.message and "\n" not in d.message for d in found)
