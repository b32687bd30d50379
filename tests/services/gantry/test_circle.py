"""A rig whose yaw turns without end: its firmware, its headings and its limits."""

import math
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from services.gantry import manual, memory, start
from services.gantry.link import Link, RigError
from services.gantry.manual import INDEX, find_home
from services.gantry.motion import Conversion, MotionLimits, Shaper, Velocity, box
from services.gantry.protocol import Position
from tests.services.gantry.fake_rig import FakeRig

LOW, HIGH = box(1.9, 1.4, math.radians(170), Conversion(circle=True))
LIMITS = MotionLimits(low=LOW, high=HIGH)


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[FakeRig]:
    with FakeRig(tmp_path / "rig") as rig:
        rig.turn = True
        yield rig


@pytest.mark.parametrize("circle", [True, False])
def test_another_firmware_is_refused_before_anything_moves(rig: FakeRig, circle: bool) -> None:
    link = Link(str(rig.path), conversion=Conversion(circle=True))
    memory.read_memory(link)
    rig.turn = circle
    link.conversion = Conversion(circle=not circle)
    with pytest.raises(RigError, match=f"is {'' if circle else 'not '}that of the kind circle: flash gantry"):
        memory.read_memory(link)
    assert {word for word, _ in rig.received} == {"LIMITS", "STATUS"}
    link.close()


@pytest.mark.parametrize("action", [("goto", "0", "0", "0"), ("calibrate",), ("check",), ("home",)])
@pytest.mark.parametrize(("turn", "kind"), [(True, ()), (False, ("--kind=circle",))])
def test_by_hand_nothing_moves_a_rig_with_the_firmware_of_the_other_kind(
    rig: FakeRig, turn: bool, kind: tuple[str, ...], action: tuple[str, ...]
) -> None:
    rig.turn = turn
    assert manual.main([f"--serial={rig.path}", *kind, *action], sys.stdout) == 1
    assert not {"GOTO", "CALIBRATE", "RUN"} & {word for word, _ in rig.received}


def test_headings_have_no_edge_and_places_do() -> None:
    shaper = Shaper(LIMITS)
    for _ in range(30):
        velocity = shaper.step(Velocity(yaw=1), Position(0, 0, 3.14), 0.05)
    assert (velocity.yaw, shaper.cut) == (1, 0)
    assert LIMITS.holds(Position(0, 0, math.pi)) and not LIMITS.holds(Position(1, 0, 0))
    assert find_home(LIMITS, Conversion(circle=True)) == Position(LOW.x, LOW.y, INDEX)


def test_a_heading_may_have_the_name_of_another_turn() -> None:
    assert start.near(Position(0, 0, -3.141), Position(0, 0, 3.141))
    assert not start.near(Position(0, 0, -3.1), Position(0, 0, 3.1))


def test_by_hand_any_heading_is_reached(rig: FakeRig, capsys: pytest.CaptureFixture[str]) -> None:
    assert manual.main([f"--serial={rig.path}", "--kind=circle", "goto", "0", "0", "350"], sys.stdout) == 0
    assert rig.commands("GOTO")[-1] == pytest.approx((0, 0, math.radians(-10)), abs=1e-4)
    assert manual.main([f"--serial={rig.path}", "--kind=circle", "goto", "2", "0", "0"], sys.stdout) == 2
    assert "any yaw" in capsys.readouterr().out
    assert manual.main([f"--serial={rig.path}", "--kind=square", "status"], sys.stdout) != 0
