"""``dodo rig``: manual use of a rig, with a rig on a pseudo terminal as the hardware."""

import json
from pathlib import Path

import pytest
import yaml

from services.gantry.rig_table import LIMITS
from tests.run.rigs.place import Place, busy, place

__all__ = ["place"]


@pytest.mark.realtime
def test_manual_use(place: Place) -> None:
    assert "fake: the rig is idle, x = -0.880 m" in place.dodo("rig", "status", code=0)
    moved = place.dodo("rig", "goto", "fake", "0.1", "-0.2", "45", code=0)
    assert "x = 0.100 m, y = -0.200 m, yaw = 45.0 degrees" in moved
    (status,) = json.loads(place.dodo("rig", "status", "fake", "--json", code=0))
    assert (status["rig"], status["word"], status["quarantine"]) == ("fake", "idle", "")
    moves = len(place.rig.commands("GOTO"))
    assert "out of the rig's ranges" in place.dodo("rig", "goto", "fake", "0", "0.5", "0", code=2)
    assert len(place.rig.commands("GOTO")) == moves
    assert "unknown rig 'fke'" in place.dodo("rig", "home", "fke", code=2)


@pytest.mark.realtime
def test_calibrate_writes_the_limits_of_the_file_into_the_rig_and_status_shows_them(place: Place) -> None:
    place.rig.memory, place.rig.source = list(map(max, LIMITS.values())), 0
    assert "limits" not in place.dodo("rig", "status", code=0)
    said = place.dodo("rig", "goto", "fake", "0", "0", "0", code=3)
    assert "has other limits than its file: y 1.4 m, expected y 1 m; calibrate it" in said
    place.dodo("rig", "calibrate", "fake", code=0)
    assert "limits in its memory: x 1.85 m, y 1 m, yaw 170 deg, speed 1 m/s" in place.dodo("rig", "status", code=0)
    place.rig.source = 2
    assert "its memory is damaged" in place.dodo("rig", "status", code=0)


@pytest.mark.realtime
def test_one_user_at_a_time(place: Place) -> None:
    with busy(place, "rig", "goto", "fake", "0", "0", "0"):
        said = place.dodo("rig", "status", "fake", "--wait", "0.3", code=3)
        assert "dodo rig goto" in said and "within 0.3 s" in said
    assert place.rig.last() == "STOP"


@pytest.mark.realtime
def test_two_repositories_that_name_one_port_exclude_each_other(place: Place, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    fake = {"kind": "dynamic", "cid": 3, "serial": str(place.rig.path.resolve()), "limits": {"y": "1 m"}}
    (other / "dodo.yml").write_text(yaml.safe_dump({"dodo": 1, "rigs": {"theirs": fake}}))
    with busy(place, "rig", "goto", "theirs", "0", "0", "0", folder=other):
        said = place.dodo("rig", "status", "fake", "--wait", "0.3", code=3)
        assert "no device came free within 0.3 s; test 'dodo rig goto'" in said


@pytest.mark.realtime
def test_status_shows_a_fault_until_calibrate_acknowledges_it(place: Place) -> None:
    place.rig.status = 3
    for _ in range(2):
        assert "the rig touched a limit switch and stopped" in place.dodo("rig", "status", code=0)
    assert "touched a limit switch" in place.dodo("rig", "home", "fake", code=3)
    assert "the rig is idle" in place.dodo("rig", "calibrate", "fake", code=0)
