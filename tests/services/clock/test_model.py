"""The same way whatever the application's manners and its speed."""

import re
import threading
from fractions import Fraction
from typing import Any

import pytest

from services.base.lockstep_clock import EPOCH
from services.clock import exchange, model
from services.clock.exchange import ApplicationFails, ServiceSilent, TimeOver
from services.clock.model import Stepper
from tests.services.clock.toys import BOX, DRIVE, STEP, Filter, Mover, Toys

Way = list[tuple[int, float]]


@pytest.fixture
def toys(cid: int) -> Toys:
    return Toys(cid)


def expected(steps: int) -> Way:
    """The way of a mover that hears of each picture's answer with the next step."""
    place, speed, way = 0.0, 1.0, []
    for step in range(steps):
        for tenth in range(10 if step else 1):
            place += speed * 0.01
            way.append(((step - 1) * STEP + (tenth + 1) * STEP // 10 if step else 0, place))
        speed = 1.5 - place
    return way


def close(way: Way, other: Way) -> bool:
    """Frames carry single precision."""
    return all(a[0] == b[0] and abs(a[1] - b[1]) < 1e-5 for a, b in zip(way, other, strict=True))


MANNERS: dict[str, dict[str, Any]] = {
    "plain": {},
    "own-sample-times": {"copies": False},
    "twice": {"times": 2},
    "twice-own-sample-times": {"times": 2, "copies": False},
    "slow-at-times": {"pause": lambda frame: 0.1 * (frame % 7 == 0)},
}


@pytest.mark.parametrize("manner", ["plain", *(pytest.param(m, marks=pytest.mark.thorough) for m in list(MANNERS)[1:])])
def test_the_way_is_as_computed_by_hand_whatever_the_manners(toys: Toys, manner: str) -> None:
    application = toys.application(**MANNERS[manner])
    way, stepper = toys.run(application)
    assert close(way, expected(21))
    assert stepper.application.frames == 21
    assert application.seen[:2] == pytest.approx([0.01, 0.11], abs=0.05)
    assert len(application.seen) in (20, 21), "every picture once"


@pytest.mark.thorough
def test_an_application_without_an_answer_of_its_own_is_awaited_by_its_readers(toys: Toys) -> None:
    """It has done what it does when it waits for the next picture; what it said is heard with the next step."""
    toys.answers, toys.relayed = (), (BOX,)
    application = toys.application(boxes=2, pause=lambda frame: 0.02 * (frame % 3))
    _, stepper = toys.run(application)
    assert (stepper.application.frames, len(application.seen)) == (21, 21)
    assert [step for step, _ in toys.evaluator.boxes] == [step for step in range(20) for _ in range(2)]


def test_an_application_without_a_camera_may_answer_at_once(toys: Toys) -> None:
    toys.cast = {"mover": lambda session, _: Mover(session)}
    way, stepper = toys.run(Filter(toys.cid))
    assert len(way) == 201
    assert stepper.application.frames == 21


def test_the_test_time_is_limited(toys: Toys) -> None:
    toys.timeout = 5 * STEP
    application = toys.application()
    with pytest.raises(TimeOver) as over:
        toys.run(application)
    assert (over.value.kind, len(application.seen) in (5, 6)) == ("timedout", True)


@pytest.mark.thorough
def test_a_service_that_does_not_answer_is_named(toys: Toys, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(model, "SERVICE_PATIENCE", 0.3)
    gone = threading.Event()

    class Hangs(Mover):
        def update(self, now: int) -> Any:
            gone.wait(0.01 if now < EPOCH + STEP else 1.0)
            return ()

    toys.cast = {**DRIVE, "mover": lambda session, _: Hangs(session)}
    with pytest.raises(ServiceSilent, match=r"^service 'mover' did not answer the clock within 0\.3 s$"):
        toys.run(toys.application())


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("patience", "manner", "said"),
    [
        ((0.5, 0.2), {"times": 0}, "frame 1 within 0.5 s (GroundSteeringRequest missing)"),
        ((2.0, 0.02), {"most": 7}, "frame 8 within 0.2 s (no reader waited for a picture of 'eye')"),
    ],
)
def test_silence_is_named_with_frame_and_cause(
    toys: Toys, monkeypatch: pytest.MonkeyPatch, patience: tuple[float, float], manner: dict[str, Any], said: str
) -> None:
    for name, seconds in zip(("FIRST_PATIENCE", "PATIENCE"), patience, strict=True):
        monkeypatch.setattr(exchange, name, seconds)
    with pytest.raises(ApplicationFails, match=re.escape(said)):
        toys.run(toys.application(**manner))


def test_the_stepper_goes_to_the_time_that_a_source_tells() -> None:
    stepper = Stepper.__new__(Stepper)
    stepper.period, stepper.now, stepper._ended = 100, 1000, {"gone"}
    stepper._exact = Fraction(1000)
    stepper._next = {"a": 0, "gone": 1001}
    stepper._go_on()
    assert stepper.now == 1100
    stepper._next = {"a": 1140, "b": 1130, "c": 900, "gone": 1001}
    stepper._go_on()
    assert stepper.now == 1130
