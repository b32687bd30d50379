"""The input of a rule."""

from pathlib import Path

from dodo_dsl.check.context import known_messages
from tests.check.contexts import context


def test_messages_of_files_that_can_be_read(tmp_path: Path) -> None:
    good, bad = tmp_path / "good.odvd", tmp_path / "bad.odvd"
    good.write_text("message my.Own [id = 3000] { float x [id = 1]; }")
    bad.write_text("message")
    standard = known_messages(())
    assert "opendlv.proxy.GroundSteeringRequest" in standard
    assert known_messages((good, bad)) - standard == {"my.Own"}


def test_it_has_what_the_test_has(tmp_path: Path) -> None:
    found = context("level: hil\nrig: emulated\n", tmp_path)
    assert found.spec is found.test.spec
    assert found.rig is not None
    assert found.rig.name == "emulated"
    assert [service.use.name for service in found.services] == ["camera", "vehicle", "pose", "track"]
    assert found.wiring is found.test.wiring
    assert found.messages == known_messages(())
