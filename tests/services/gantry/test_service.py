"""The service against a rig on a pseudo terminal, as a process and in this one."""

import contextlib
import itertools
import math
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session
from services.base import Context
from services.base.flags import load_manifest, parse
from services.gantry import link, start
from services.gantry.link import Link, RigError
from services.gantry.service import Gantry
from tests.services.built import built, hand, refusal
from tests.services.gantry.fake_rig import FakeRig
from tests.services.process import PATIENCE, ROOT, launch, receive, running, send

FRAME, STATE, STATUS = "opendlv.sim.Frame", "opendlv.sim.KinematicState", "opendlv.system.SystemStatusMessage"
INSTANTS = itertools.count(0, 100_000)
MANIFEST = load_manifest(ROOT / "services" / "gantry")


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[FakeRig]:
    with FakeRig(tmp_path / "rig") as one:
        yield one


def until(true: Callable[[], object]) -> None:
    end = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < end, "it did not come to be"
        time.sleep(0.005)


@contextlib.contextmanager
def gantry(cid: int, rig: FakeRig, *flags: str) -> Iterator["subprocess.Popen[str]"]:
    with running("gantry", rig.path.parent, f"--cid={cid}", f"--serial={rig.path}", "--freq=50", *flags) as process:
        yield process


def drive(session: Session, true: Callable[[], object], **fields: float) -> None:
    """Send the state until something is true."""

    def arrived() -> object:
        send(session, STATE, **fields)
        return true()

    until(arrived)


def drive_here(model: Gantry, true: Callable[[], object], **fields: float) -> None:
    """As `drive`, without a process."""

    def arrived() -> object:
        hand(model, STATE, 0, 0, **fields)
        turn(model, 1)
        return true()

    until(arrived)


@pytest.mark.realtime
def test_it_starts_where_it_is_told_and_follows_the_vehicle(cid: int, rig: FakeRig) -> None:
    with Session(cid) as session, gantry(cid, rig, "--x=-0.5", "--y=0.1", "--yaw=90", "--status-id=4"):
        assert rig.at == pytest.approx([-0.5, 0.1, math.pi / 2], abs=1e-3)
        assert not rig.commands("CALIBRATE")
        _, frame = receive(session, FRAME)
        assert [frame.x, frame.y, frame.z] == pytest.approx([-0.5, 0.1, 0], abs=1e-3)
        assert [frame.qx, frame.qy, frame.qz, frame.qw] == pytest.approx([0, 0, 0.5**0.5, 0.5**0.5], abs=1e-3)
        drive(session, lambda: rig.at[1] > 0.12, vx=0.2)
        assert rig.at[0] == pytest.approx(-0.5, abs=0.01)
        result = {receive(session, STATUS, 4)[1].description for _ in range(1)}
        assert result <= {"the rig is idle", "the rig is moving"}
        envelope, frame = receive(session, FRAME)
        while frame.y < 0.12:
            envelope, frame = receive(session, FRAME)
        assert abs(envelope.sample_time - envelope.sent) < 1_000_000


@pytest.mark.realtime
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_stops_the_rig(cid: int, rig: FakeRig, number: signal.Signals) -> None:
    with Session(cid) as session, gantry(cid, rig) as process:
        drive(session, lambda: any(rig.velocity), vx=0.3)
        process.send_signal(number)
        assert process.wait(PATIENCE) == 0
        assert rig.last() == "STOP" and not any(rig.velocity)


@pytest.mark.realtime
def test_a_vehicle_that_falls_silent_is_not_driven_on(cid: int, rig: FakeRig) -> None:
    with Session(cid) as session, gantry(cid, rig):
        drive(session, lambda: any(rig.velocity), vx=0.3)
        until(lambda: not any(rig.velocity))
        assert rig.last() == "RUN" and rig.status == 0


@pytest.mark.parametrize(
    ("status", "words"),
    [
        (3, "touched a limit switch"),
        (4, "a motor stalled"),
        (5, "too hot"),
        (6, "is not calibrated"),
        (7, "got no command for 500 ms and braked by itself"),
        (8, "reports a fault"),
    ],
)
def test_a_status_that_ends_the_test(rig: FakeRig, status: int, words: str) -> None:
    with ready(rig) as model:
        rig.status = status
        with pytest.raises(RigError, match=words) as raised:
            turn(model)
    assert f"(status {status})" in str(raised.value) and "at x = 0.000 m" in str(raised.value)
    assert rig.status == status * (status != 7) and not any(rig.velocity), (
        "a fault is left to be seen, and 7 ends with STOP"
    )


@pytest.mark.parametrize(("status", "words"), [(3, "touched a limit switch"), (4, "a motor stalled"), (8, "a fault")])
def test_a_fault_from_before_is_seen_and_not_erased(rig: FakeRig, status: int, words: str) -> None:
    rig.status = status
    assert words in refused(rig, f"--serial={rig.path}", "--calibrate")
    assert rig.status == status and not rig.commands("STOP") and not rig.commands("CALIBRATE")


@pytest.mark.parametrize(("code", "name"), [(8, "TROUBLE"), (99, "unknown to this version")])
def test_a_rig_that_refuses_to_move_ends_the_test(rig: FakeRig, code: int, name: str) -> None:
    with ready(rig) as model:
        drive_here(model, lambda: any(rig.velocity), vx=0.2)
        rig.restarted = code
        with pytest.raises(RigError, match=re.escape(f"refuses to move: $ERROR:{code} ({name})")):
            turn(model)
    assert rig.last() == "STOP" and not any(rig.velocity)


def test_an_outage_of_the_line_ends_the_test(rig: FakeRig) -> None:
    with ready(rig) as model:
        drive_here(model, lambda: any(rig.velocity), vx=0.2)
        rig.unplug()
        with pytest.raises(RigError, match=rf"the line to the rig at {rig.path} is lost: (?!\[Errno)"):
            turn(model)
        rig.plug()


@pytest.mark.thorough
def test_a_rig_that_never_answers(rig: FakeRig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "PATIENCE", 0.5)
    rig.silent = True
    assert refused(rig) == f"the rig at {rig.path} gave no answer for 0.5 s"


def test_who_moves_the_vehicle_and_who_runs_the_test_may_not_fall_silent(rig: FakeRig) -> None:
    flags = parse(MANIFEST, ["--cid=1", f"--serial={rig.path}", "--freq=10"])
    line, now = Link(str(rig.path)), [100.0]
    with contextlib.closing(line):
        start.settle(line, start.find(line))
        model = Gantry(Context("gantry", flags, MessageSet.standard()), line, wall=lambda: now[0])
        state, alive = MessageSet.standard().type(STATE)(vx=0.2), MessageSet.standard().type("dodo.Alive")
        for name, patience, words in (
            (STATE, 1.0, "no KinematicState"),
            ("dodo.Alive", 3.0, "the runner has given no"),
        ):
            (hear_it,) = (handler for (message, _), handler in model.inputs.items() if message == name)
            now[0] += 10  # never heard, never missed
            list(model.update(round(now[0] * 1e6)))
            hear_it(state if name == STATE else alive(time=5), 0)
            now[0] += patience - 0.01
            list(model.update(round(now[0] * 1e6)))
            now[0] += 0.2
            if name != STATE:
                hear_it(alive(time=5), 0)  # repeated by somebody else
            with pytest.raises(RigError, match=words):
                list(model.update(round(now[0] * 1e6)))
            model.end_of_input(0)  # nothing more is expected to come


@contextlib.contextmanager
def ready(rig: FakeRig, *flags: str) -> Iterator[Gantry]:
    """The service in this process, at its start, after some turns."""
    with built("gantry", f"--serial={rig.path}", "--freq=10", *flags) as model:
        turn(model, 3)
        yield model


def turn(model: Gantry, count: int = 200) -> None:
    for _ in range(count):
        list(model.update(next(INSTANTS)))


def refused(rig: FakeRig, *flags: str) -> str:
    return refusal("gantry", *(flags or (f"--serial={rig.path}",)))


@pytest.mark.thorough
def test_it_calibrates_only_on_request(rig: FakeRig) -> None:
    rig.calibrated = False
    error = refused(rig)
    assert "is not calibrated and does not know its position (status 6); --calibrate makes it find its home" in error
    assert not rig.commands("CALIBRATE") and not rig.commands("GOTO")
    with ready(rig, "--calibrate"):
        assert rig.commands("CALIBRATE") == [()]
        assert rig.at == pytest.approx([0, 0, 0], abs=1e-3)


@pytest.mark.realtime
def test_a_signal_on_the_way_to_the_start_stops_the_rig(cid: int, rig: FakeRig) -> None:
    rig.status = 1  # never idle
    process = launch("gantry", rig.path.parent, f"--cid={cid}", f"--serial={rig.path}")
    until(lambda: rig.commands("GOTO"))
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out, err) == (0, "", "")
    assert rig.last() == "STOP"


@pytest.mark.thorough
def test_a_start_that_is_not_reached(rig: FakeRig) -> None:
    rig.status = 2
    error = refused(rig, f"--serial={rig.path}", "--patience=1", "--x=0.2")
    assert "has not reached x = 0.2 m, y = 0 m, yaw = 0 degrees after 1 s" in error
    assert rig.last() == "STOP"


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--serial=spy:///dev/ttyACM0?file=/tmp/x"], "is not a device"),
        (["--serial=socket://10.0.0.1:80"], "is not a device"),
        (["--serial=/etc/passwd"], "is not a device"),
        (["--serial=ttyACM0"], "is not a device"),
        (["--serial=/dev/ttyNONE7"], "there is no serial port /dev/ttyNONE7; is the rig plugged in?"),
        (["--serial=emulated"], "the emulated rig is not built: build it in DODO_FIRMWARE, which is "),
        (["--serial=/dev/null", "--range-x=0.5"], "the start is out of the rig's ranges: at x = 0.000 m"),
    ],
)
def test_what_is_not_a_rig(
    rig: FakeRig, flags: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DODO_FIRMWARE", str(tmp_path))
    assert words in refused(rig, *flags)


def test_the_rigs_frame_in_the_world(rig: FakeRig) -> None:
    flags = parse(MANIFEST, ["--cid=1", f"--serial={rig.path}", "--origin-x=5", "--origin-y=1", "--origin-yaw=90"])
    line = Link(str(rig.path))
    with contextlib.closing(line):
        model = Gantry(Context("gantry", flags, MessageSet.standard()), line)
        outputs = [output for now in range(20) for output in model.update(now)]
    frame = outputs[-1].message
    assert [frame.x, frame.y] == pytest.approx([5 + 0.1, 1 + 0.1], abs=1e-3)
    assert [frame.qz, frame.qw] == pytest.approx([0.5**0.5] * 2, abs=1e-3)
