"""The limits of the rig's file in its memory: agreed upon before anything moves."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from services.gantry.link import Link, PortError, RigError
from services.gantry.memory import agree, wanted
from services.gantry.motion import Conversion
from services.gantry.protocol import Limits, answer
from services.gantry.rig_table import LIMITS, Source
from tests.services.built import built, refusal
from tests.services.gantry.fake_rig import FakeRig

BUILT = tuple(widest for _, widest in LIMITS.values())
TEXT = "x=1.2,speed=0.4,yaw-rate=0.3,acceleration=0.25"
TIGHT = (1.2, 1.4, 2.967059, 0.4, 0.5, 0.25, 1.0)
MOVES = {"GOTO", "CALIBRATE", "RUN"}


@pytest.fixture
def line(tmp_path: Path) -> Iterator[tuple[FakeRig, Link]]:
    with FakeRig(tmp_path / "rig") as rig:
        link = Link(str(rig.path))
        yield rig, link
        link.close()


def words(rig: FakeRig) -> list[str]:
    return [word for word, _ in list(rig.received)]


@pytest.mark.parametrize(
    ("text", "name", "limit"),
    [
        (None, "speed", 1.0),
        ("speed=0.4", "speed", 0.4),
        ("speed=2", "speed", 1.0),
        ("x=1.9", "x", 1.85),
        ("x=0.01", "x", 0.1),
        ("yaw=0.78539816", "yaw", 0.7853),
        ("acceleration=0.29", "acceleration", 0.29),
    ],
)
def test_a_limit_of_the_file_is_what_the_memory_has_next_below(text: str | None, name: str, limit: float) -> None:
    assert wanted(text, Conversion())[name] == pytest.approx(limit, abs=1e-9)


@pytest.mark.parametrize(("text", "circle"), [("speed", False), ("pace=1", False), ("x=-1", False), ("yaw=1", True)])
def test_what_is_no_limit(text: str, circle: bool) -> None:
    with pytest.raises(PortError, match="is not a limit"):
        wanted(text, Conversion(circle=circle))


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (
            "$LIMITS:1.850000,1.400000,2.967059,1.000000,1.000000,0.500000,1.000000,0",
            Limits(BUILT, Source.BUILT),
        ),
        ("$LIMITS:1.850000,1.400000,2.967059,1.000000,1.000000,0.500000,1.000000,7", None),
        ("$LIMITS:1.850000,1.400000,0", None),
        ("$LIMITS:1.850000,1.400000,2.967059,1.000000,1.000000,-0.500000,1.000000,0", None),
    ],
)
def test_the_answer_to_limits(text: str, found: Limits | None) -> None:
    assert answer(text) == found


@pytest.mark.parametrize("write", [False, True])
def test_limits_that_the_memory_has_are_not_written(line: tuple[FakeRig, Link], write: bool) -> None:
    rig, link = line
    agree(link, wanted(None, Conversion()), write)
    rig.memory, rig.source = list(TIGHT), 1
    agree(link, wanted(TEXT, Conversion()), write)
    assert set(words(rig)) == {"LIMITS", "STATUS"} and rig.calibrated


def test_others_are_written_and_read_back_before_anything_moves(line: tuple[FakeRig, Link]) -> None:
    rig, link = line
    agree(link, wanted(TEXT, Conversion()), write=True)
    assert rig.memory == pytest.approx(TIGHT) and not rig.calibrated
    order = [word for word in words(rig) if word != "STATUS"]
    assert order == ["LIMITS", "STOP", "FORGET", "SETLIMITS", "LIMITS"]


def test_others_are_an_error_where_they_may_not_be_written(line: tuple[FakeRig, Link]) -> None:
    rig, link = line
    with pytest.raises(RigError, match=r"other limits than its file: x 1\.85 m, .* expected x 1\.2 m.*; calibrate it"):
        agree(link, wanted(TEXT, Conversion()), write=False)
    assert rig.calibrated and not MOVES & set(words(rig)) and "SETLIMITS" not in words(rig)


def test_only_an_operator_makes_kept_limits_wider(line: tuple[FakeRig, Link]) -> None:
    rig, link = line
    rig.memory, rig.source = list(TIGHT), 1
    with pytest.raises(PortError, match=r"other limits than its file: .*; only 'dodo rig calibrate' makes them wider"):
        agree(link, wanted(None, Conversion()), write=True)
    assert rig.calibrated and not MOVES & set(words(rig)) and "SETLIMITS" not in words(rig)
    agree(link, wanted(None, Conversion()), write=True, widen=True)
    assert rig.memory == pytest.approx(BUILT)


def test_a_damaged_memory_is_an_error_and_is_written_again(line: tuple[FakeRig, Link]) -> None:
    rig, link = line
    rig.memory, rig.source = [low for low, _ in LIMITS.values()], 2
    with pytest.raises(RigError, match="is damaged, and the narrowest limits hold"):
        agree(link, wanted(None, Conversion()), write=False)
    agree(link, wanted(None, Conversion()), write=True)
    assert (rig.memory, rig.source) == (pytest.approx(BUILT), 1)


def test_a_memory_that_takes_nothing_is_an_error(line: tuple[FakeRig, Link]) -> None:
    rig, link = line
    rig.forgetful = True
    with pytest.raises(RigError, match="although it was written"):
        agree(link, wanted(TEXT, Conversion()), write=True)


@pytest.mark.thorough
def test_the_service_writes_them_when_it_calibrates(line: tuple[FakeRig, Link]) -> None:
    rig, link = line
    link.close()
    rig.received.clear()
    assert "calibrate it" in refusal("gantry", f"--serial={rig.path}", f"--limits={TEXT}")
    assert not MOVES & set(words(rig))
    with built("gantry", f"--serial={rig.path}", f"--limits={TEXT}", "--calibrate") as model:
        limits = model.shaper.limits  # type: ignore[attr-defined]
        assert (limits.speed, limits.acceleration, limits.yaw_rate) == (0.4, 0.25, 0.5)
        assert limits.high.x == pytest.approx(0.3)
    order = words(rig)
    assert order.index("SETLIMITS") < order.index("CALIBRATE") < order.index("GOTO")
