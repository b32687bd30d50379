"""Rigs, of hardware and emulated."""

import pytest

from dodo_dsl.source import Scalar
from dodo_dsl.spec.rig import EMULATED, EMULATED_FILE, Rig, emulated
from tests.source.nodes import mapping

KIWI = Rig("kiwi", "static", 121, mapping("kind: static\ncamera: {width: 640}\nprivileged: true\n"))


def test_hardware_and_the_emulated_rig() -> None:
    assert (KIWI.is_emulated, KIWI.tag, KIWI.isolation, KIWI.privileged) == (False, "hil-static", "host", True)
    rig = emulated()
    assert (rig.name, rig.cid) == (EMULATED, None)
    assert (rig.is_emulated, rig.tag, rig.isolation, rig.privileged) == (True, "sil", "network", False)


@pytest.mark.parametrize("key", ["", "camera.height", "kind.width", "camera.width.x", "other"])
def test_keys_that_a_rig_does_not_have(key: str) -> None:
    assert KIWI.entry(key) is None


def test_its_entries() -> None:
    entry = KIWI.entry("camera.width")
    assert entry is not None
    assert isinstance(entry.value, Scalar)
    assert entry.value.value == 640
    source = emulated().entry("camera.source")
    assert source is not None
    assert source.key.file == EMULATED_FILE
