"""No isolation of its own leads a test on a real rig around lease, health check and quarantine."""

import json

import pytest

from tests.drive.applications import results
from tests.run.rigs.place import APPLICATION, Place, place

__all__ = ["place"]
pytestmark = pytest.mark.slow


def test_no_isolation_leads_around_a_rigs_checks(place: Place) -> None:
    words = ("--isolation", "network")
    said = place.dodo("run", "hil-fake", *APPLICATION, *words, code=2)
    assert "error[rig-isolation]: rig 'fake' is reached through the host" in said
    assert "hint: run it without --isolation\n" in said
    place.dodo("compile", "tests/hil-fake", *APPLICATION, "-o", "generated", code=0)
    assert "'fake' is reached through the host" in place.dodo("run", "--compiled", "generated/hil-fake", *words, code=2)
    assert place.rig.received == []


def test_a_plan_with_a_network_of_its_own_is_examined_all_the_same(place: Place) -> None:
    place.dodo("compile", "tests/hil-fake", *APPLICATION, "-o", "generated", code=0)
    file = place.folder / "generated" / "hil-fake" / "test.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), "isolation": "network"}))
    place.rig.unplug()
    place.dodo("run", "--compiled", str(file.parent), "--backend", "process", code=3)
    (test,) = results(place.folder / "dodo-report").values()
    assert test["reason"].startswith("rig 'fake' cannot be checked: '")
    assert list((place.folder / "leases").glob("*.lease")) == []
    assert not list((place.folder / "state").glob("*"))
