"""What is written into dodo.yml, and what stays."""

import re
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from dodo_dsl.run.rigs.rig_entry import NotWritten, changed, write

X, OFFSET = ("axes", "x", "steps"), ("axes", "x", "offset")
VALUES = {X: "3223.3 steps/m", OFFSET: "2965.4 steps", ("axes", "yaw", "steps"): "0.55 steps/deg"}
FLOW = """\
dodo: 1
rigs:
  kiwi: {kind: dynamic, cid: 121, limits: {x: 1.5 m}}  # on the desk
  other: {kind: static, cid: 4}
"""
BLOCK = """\
dodo: 1
rigs:
  kiwi:
    # of the desk
    kind: dynamic  # it moves
    cid: 121
    limits:
      x: 1.5 m  # the wall

  # the other
  other:
    kind: static
    cid: 4"""
MEASURED = """\
dodo: 1
rigs:
  kiwi:
    axes:
      x:
        steps: '3300 steps/m' # of 2024
    kind: dynamic
    cid: 121
"""


def test_a_flow_mapping_gets_lines_of_its_own() -> None:
    assert changed(FLOW, "kiwi", VALUES).splitlines()[2:5] == [
        "  kiwi: {kind: dynamic, cid: 121, limits: {x: 1.5 m},",
        "    axes: {x: {steps: 3223.3 steps/m, offset: 2965.4 steps},",
        "      yaw: {steps: 0.55 steps/deg}}}  # on the desk",
    ]


def test_a_block_mapping_gets_an_entry_at_its_end() -> None:
    new = changed(BLOCK, "kiwi", VALUES).splitlines()
    assert new[8] == "    axes: {x: {steps: 3223.3 steps/m, offset: 2965.4 steps},"
    assert [*new[:8], *new[10:]] == BLOCK.splitlines()


def test_what_was_measured_before_is_replaced() -> None:
    new = changed(MEASURED, "kiwi", VALUES).splitlines()
    assert new[5:8] == [
        "        steps: 3223.3 steps/m # of 2024",
        "        offset: 2965.4 steps",
        "      yaw: {steps: 0.55 steps/deg}",
    ]


@pytest.mark.parametrize("text", [FLOW, BLOCK, MEASURED, FLOW.replace("\n", "\r\n"), f"\ufeff{BLOCK}"])
def test_nothing_is_lost_and_twice_is_once(text: str) -> None:
    new = changed(text, "kiwi", VALUES)
    assert changed(new, "kiwi", VALUES) == new
    before, after = yaml.safe_load(text), yaml.safe_load(new)
    axes = after["rigs"]["kiwi"].pop("axes")
    before["rigs"]["kiwi"].pop("axes", None)
    assert after == before
    assert axes == {"x": {"steps": "3223.3 steps/m", "offset": "2965.4 steps"}, "yaw": {"steps": "0.55 steps/deg"}}
    assert re.findall("#.*", new) == re.findall("#.*", text)
    assert (("\r\n" in new) == ("\r\n" in text) and "\n" not in new.replace("\r\n", "")) or "\r\n" not in text


@pytest.mark.parametrize(
    "text",
    [
        "dodo: 1\nrigs: {kiwi: &a {kind: dynamic, cid: 121}, other: *a}\n",
        "dodo: 1\nrigs: {other: &a {kind: dynamic, cid: 121}, kiwi: *a}\n",
        "dodo: 1\nrigs: {kiwi: {kind: dynamic, cid: 121, axes: {x: &a {steps: 1}, y: *a}}}\n",
    ],
)
def test_what_would_change_more_is_refused_and_said(text: str) -> None:
    with pytest.raises(
        NotWritten, match=r"write below 'rigs: kiwi:' by hand: axes: {x: {steps: 3223.3 steps/m, offset"
    ):
        changed(text, "kiwi", VALUES)


def test_a_link_stays_one_and_a_list_is_replaced(tmp_path: Path) -> None:
    real = tmp_path / "real.yml"
    real.write_text("dodo: 1\nrigs:\n  kiwi:\n    cid: 121\n    list:\n      - 1\n      - 2\n    kind: dynamic\n")
    (tmp_path / "dodo.yml").symlink_to(real)
    write(tmp_path / "dodo.yml", "kiwi", {("list",): "[0.1, 3]"})
    assert (tmp_path / "dodo.yml").is_symlink()
    assert yaml.safe_load(real.read_text())["rigs"]["kiwi"] == {"cid": 121, "list": [0.1, 3], "kind": "dynamic"}


keys = st.sampled_from(["kind", "cid", "limits", "axes", "x"])
trees = st.recursive(
    st.sampled_from(["1 m", 121, "a # b", "x: y", "", "two\nlines", None, True]),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(keys, inner, max_size=3),
    max_leaves=8,
)


@settings(deadline=None)
@given(st.dictionaries(keys, trees, max_size=4), trees, st.sampled_from([True, False, None]), st.booleans())
@pytest.mark.thorough
def test_whatever_the_style_all_else_stays(rig: "dict[str, object]", after: object, flow: bool, last: bool) -> None:
    rigs = {"kiwi": rig} if last else {"kiwi": rig, "other": after}
    text = yaml.safe_dump({"dodo": 1, "rigs": rigs}, default_flow_style=flow, sort_keys=False)
    try:
        new = changed(text, "kiwi", VALUES)
    except NotWritten:
        axes: object = rig.get("axes", {})
        inner = [axes.get(name, {}) for name in ("x", "yaw")] if isinstance(axes, dict) else [None]
        assert not all(isinstance(each, dict) for each in inner), text
        return
    tree = yaml.safe_load(new)
    axes = tree["rigs"]["kiwi"].get("axes")
    assert axes["x"]["steps"] == "3223.3 steps/m"
    rest = {k: v for k, v in tree["rigs"]["kiwi"].items() if k != "axes"}
    assert rest == {k: v for k, v in yaml.safe_load(text)["rigs"]["kiwi"].items() if k != "axes"}
    assert tree["rigs"].get("other") == yaml.safe_load(text)["rigs"].get("other")
