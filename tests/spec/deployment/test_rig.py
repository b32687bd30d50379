"""Rigs, of hardware and emulated."""

import json
import os
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.source import Scalar
from dodo_dsl.spec.rig import (
    CIRCLE,
    EMULATED,
    EMULATED_CIRCLE,
    LIMIT_UNITS,
    MEMORY,
    Rig,
    emulated,
    is_simulated,
)
from services.gantry.memory import UNITS
from services.gantry.rig_table import LIMITS
from tests.source.nodes import mapping

KIWI = Rig("kiwi", "static", 121, mapping("kind: static\ncamera: {width: 640}\nprivileged: true\n"))


def test_hardware_and_the_emulated_rig() -> None:
    assert (KIWI.is_emulated, KIWI.tag, KIWI.isolation, KIWI.privileged) == (False, "hil-static", "host", True)
    rig = emulated()
    assert (rig.name, rig.cid) == (EMULATED, None)
    assert (rig.is_emulated, rig.tag, rig.isolation, rig.privileged) == (True, "hil-dynamic", "network", False)


def test_one_that_the_deployment_emulates_has_the_size_of_its_frames_alone() -> None:
    text = "kind: {}\nserial: /dev/ttyACM0\ncamera: {{source: rpicam, width: 320}}\nlimits: {{x: 1 m}}\ntags: [rig-2]\n"
    rig, still = (Rig("bench", kind, None, mapping(text.format(kind))) for kind in ("dynamic", "static"))
    keys = ("serial", "camera.source", "camera.width", "camera.height", "limits.x")
    assert [rig.text(key) for key in keys] == ["emulated", "emulated", "320", "480", ""]
    assert (rig.tag, rig.more_tags, rig.entry(MEMORY), still.text("serial")) == ("sil", (), None, "")
    assert (rig.is_missing, emulated("static").is_missing, emulated("static").tag) == (False, True, "hil-static")


def test_its_runner_may_have_more_tags_than_that_of_its_kind() -> None:
    tagged = Rig("kiwi", "dynamic", 121, mapping("tags: [hil-dynamic, rig-2, rig-2, cellar]\n"))
    assert (tagged.tag, tagged.more_tags) == ("hil-dynamic", ("rig-2", "cellar"))
    assert KIWI.more_tags == emulated().more_tags == ()


def test_a_rig_that_turns_without_end_alone_gives_its_kind_to_the_gantry() -> None:
    endless = emulated(EMULATED_CIRCLE)
    assert (endless.name, endless.kind, endless.is_emulated) == (EMULATED_CIRCLE, CIRCLE, True)
    for it in (endless, Rig("round", CIRCLE, 122, mapping("kind: circle\n"))):
        assert (it.tag, it.more_tags) == ("hil-dynamic", ("hil-circle",))
    entry = endless.entry(CIRCLE)
    assert entry is not None and isinstance(entry.value, Scalar) and entry.value.value == CIRCLE
    assert emulated().entry(CIRCLE) is None and KIWI.entry(CIRCLE) is None


def test_its_limits_are_one_text_for_its_memory() -> None:
    rig = Rig("kiwi", "dynamic", 121, mapping("limits: {speed: 40 cm/s, x: 150 cm, yaw: 90 deg}\n"))
    entry = rig.entry(MEMORY)
    assert entry is not None and isinstance(entry.value, Scalar) and entry is rig.entry(MEMORY)
    assert entry.value.text == "x=1.5,yaw=1.5707963267949,speed=0.4"
    assert KIWI.entry(MEMORY) is None and emulated().entry(MEMORY) is None


def test_limits_have_the_names_and_units_of_the_schema_and_of_the_rigs_memory() -> None:
    schema = json.loads((package_data.schemas() / "deployment.schema.json").read_text())
    limits = schema["$defs"]["limits"]["properties"]
    assert {name: about["x-unit"] for name, about in limits.items()} == {**LIMIT_UNITS, "yaw": "deg"}
    assert LIMIT_UNITS == UNITS
    assert list(LIMIT_UNITS) == list(LIMITS)


def test_a_pseudo_terminal_has_a_program_at_its_other_end(tmp_path: Path) -> None:
    ours, theirs = os.openpty()
    link = tmp_path / "port"
    link.symlink_to(os.ttyname(theirs))
    assert is_simulated(str(link)) and is_simulated(os.ttyname(theirs)) and is_simulated("emulated")
    os.close(ours)
    os.close(theirs)
