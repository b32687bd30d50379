"""A service of the vehicle that is killed and started anew in the middle of a test: its neighbours go on."""

import time
from collections.abc import Callable
from pathlib import Path

import pytest

from dodo_dsl.opendlv.session import Session
from tests.services.process import PATIENCE, receive, running, send

FRAME, STATE, PEDAL = "opendlv.sim.Frame", "opendlv.sim.KinematicState", "opendlv.proxy.PedalPositionRequest"


def pressed(session: Session, message: str, true: Callable[[float], bool], pedal: float = 0.14) -> float:
    """Press the pedal until vx or x of what is heard is so."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        send(session, PEDAL, position=pedal)
        heard = receive(session, message)[1]
        value = float(heard.x if message == FRAME else heard.vx)
        if true(value):
            return value
    raise AssertionError("it did not come to be")


@pytest.mark.realtime
def test_the_integrator_survives_a_restart_of_the_dynamic_model(cid: int, tmp_path: Path) -> None:
    with Session(cid) as session, running("integrator", tmp_path, f"--cid={cid}") as integrator:
        with running("dynamic_model", tmp_path, f"--cid={cid}") as first:
            reached = pressed(session, FRAME, lambda x: x > 0.02)
            first.kill()
            first.wait(PATIENCE)
        last = receive(session, FRAME)[1].x
        assert last >= reached
        with running("dynamic_model", tmp_path, f"--cid={cid}"):
            pressed(session, STATE, lambda vx: 0 <= vx < 0.05, pedal=0.0)
            begin = receive(session, FRAME)[1].x
            assert begin >= last
            pressed(session, FRAME, lambda x: x > begin + 0.02)
        assert integrator.poll() is None


@pytest.mark.realtime
def test_the_dynamic_model_survives_a_restart_of_the_integrator(cid: int, tmp_path: Path) -> None:
    with Session(cid) as session, running("dynamic_model", tmp_path, f"--cid={cid}") as vehicle:
        for start in (0, 5):
            with running("integrator", tmp_path, f"--cid={cid}", f"--x={start}") as process:
                pressed(session, FRAME, lambda x, start=start: x > start + 0.02)  # type: ignore[misc]
                process.kill()
                process.wait(PATIENCE)
            while session.receive(0.0) is not None:
                pass
            assert vehicle.poll() is None
            pressed(session, STATE, lambda vx: vx > 0.1)
