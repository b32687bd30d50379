"""What is written into dodo.yml, and what stays."""

import re
from pathlib import Path

import pytest
import yaml

from dodo_dsl.run.rigs.rig_entry import NotWritten, changed, write

VALUE = {"x": {"steps": "3223.3 steps/m", "offset": "2965.4 steps"}, "yaw": {"steps": "0.55 steps/deg"}}
LINE = "axes: {x: {steps: 3223.3 steps/m, offset: 2965.4 steps}, yaw: {steps: 0.55 steps/deg}}"
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
MEASURED = BLOCK.replace("    cid: 121\n", "    axes:\n      x:\n        steps: 3300 steps/m\n\n    cid: 121\n")
BEFORE = FLOW.replace("limits", "axes: {yaw: {offset: 80 steps}}, limits")


@pytest.mark.parametrize("text", [FLOW, BLOCK, MEASURED, BEFORE, FLOW.replace("\n", "\r\n"), f"\ufeff{BLOCK}"])
def test_nothing_is_lost_and_twice_is_once(text: str) -> None:
    new = changed(text, "kiwi", ("axes",), VALUE)
    assert changed(new, "kiwi", ("axes",), VALUE) == new
    before, after = yaml.safe_load(text), yaml.safe_load(new)
    axes, kept = (tree["rigs"]["kiwi"].pop("axes", {}) for tree in (after, before))
    assert after == before
    assert axes == {**VALUE, "yaw": {**kept.get("yaw", {}), "steps": "0.55 steps/deg"}}
    assert re.findall("#.*", new) == re.findall("#.*", text)
    assert LINE in new or text == BEFORE


def test_a_camera_keeps_its_other_keys(tmp_path: Path) -> None:
    real = tmp_path / "real.yml"
    real.write_text("dodo: 1\nrigs:\n  kiwi: {camera: {source: rpicam, width: 640}, cid: 4}\n")
    (tmp_path / "dodo.yml").symlink_to(real)
    write(tmp_path / "dodo.yml", "kiwi", ("camera", "intrinsics"), {"width": 640, "k1": -0.1})
    assert (tmp_path / "dodo.yml").is_symlink()
    camera = {"source": "rpicam", "width": 640, "intrinsics": {"width": 640, "k1": -0.1}}
    assert yaml.safe_load(real.read_text())["rigs"]["kiwi"] == {"cid": 4, "camera": camera}


@pytest.mark.parametrize(
    "text",
    [
        "dodo: 1\nrigs: {kiwi: &a {kind: dynamic, cid: 121}, other: *a}\n",
        "dodo: 1\nrigs: {other: &a {kind: dynamic, cid: 121}, kiwi: *a}\n",
        "dodo: 1\nrigs: {kiwi: {kind: dynamic, cid: 121, axes: &a {x: {steps: 1}}}, other: {axes: *a}}\n",
        MEASURED.replace("steps/m\n", "steps/m # of 2024\n"),
    ],
)
def test_what_would_change_more_is_refused_and_said(text: str) -> None:
    with pytest.raises(NotWritten, match=r"axes of 'kiwi' cannot be changed .*; write it by hand: axes: {x: {steps:"):
        changed(text, "kiwi", ("axes",), VALUE)
