"""What only a simulation has goes to the test's services, and not to the bus."""

from collections.abc import Iterator

import pytest

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session, SessionError
from services.base.clock import RealTimeClock
from services.base.loop import Loop
from services.base.members import TOLD, TRUTH, WORLD_VARIABLE, Members
from services.base.service import Output, Service
from tests.services.base.identity.conftest import Join

FRAME, STATE, READING = "opendlv.sim.Frame", "opendlv.sim.KinematicState", "opendlv.proxy.DistanceReading"
MESSAGES = MessageSet.standard()


class Teller(Service):
    """Sends one message of each kind, and is finished."""

    period = 1_000

    def update(self, now: int) -> list[Output]:
        self.finished = True
        return [Output(MESSAGES.type(name)(), 0) for name in (FRAME, STATE, READING)]


@pytest.fixture(autouse=True)
def world(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(WORLD_VARIABLE, "pose track own?=opendlv.sim.KinematicState/0")


@pytest.fixture
def application(cid: int) -> Iterator[Session]:
    with Session(cid) as session:
        session.hear_directly()
        yield session


def taken(session: Session, members: Members | None = None) -> list[str | None]:
    """Names of what comes, and of it what counts."""
    names: list[str | None] = []
    while (envelope := session.receive(0.0)) is not None:
        if members is None or members.admits(envelope):
            names.append(session.messages.name(envelope.data_type))
    return names


def tell(session: Session, members: Members | None) -> None:
    Loop("pose", Teller(), session, RealTimeClock(), 0, members).run(lambda: False)


def frame(name: str = FRAME) -> Envelope:
    return Envelope(MESSAGES.id(name), MESSAGES.encode(MESSAGES.type(name)()), 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("told", "truth", "heard"),
    [
        pytest.param("", "", [READING], id="it hears readings alone"),
        pytest.param(f"{FRAME}/0", "", [FRAME, READING], id="declared"),
        pytest.param(f"{READING}/0", f"{READING}/0", [], id="truth never, as it is judged by it"),
    ],
)
def test_services_hear_all_and_the_application_what_it_may(
    enter: Join, application: Session, monkeypatch: pytest.MonkeyPatch, told: str, truth: str, heard: list[str]
) -> None:
    for name, value in ((TOLD, told), (TRUTH, truth)):
        if value:
            monkeypatch.setenv(name, value)
    pose, track = enter("pose"), enter("track")
    tell(*pose)
    everything = [FRAME, STATE, READING, "dodo.EndOfInput"]
    assert sorted(map(str, taken(*track))) == sorted(everything), "which come by two sockets, in any order"
    assert taken(application) == heard


def test_what_reaches_no_service_of_the_test_does_not_come_to_the_bus(
    application: Session, cid: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(WORLD_VARIABLE, "pose track")
    with Session(cid) as session, pytest.raises(SessionError, match=f"'{FRAME}' must not come to the bus"):
        tell(session, None)
    assert taken(application) == []


def test_a_service_that_does_not_say_where_it_listens_hears_it_on_the_bus(
    enter: Join, application: Session, capsys: pytest.CaptureFixture[str]
) -> None:
    """From the begin on: before it, it may still come to say so."""
    pose = enter("pose")
    pose[1].send(frame(STATE))
    assert taken(application) == []
    pose[1].begin()
    pose[1].send(frame(STATE))
    pose[1].send(frame(STATE))
    pose[1].send(frame())
    assert taken(application) == [STATE, STATE]
    assert capsys.readouterr().out.count("the application can hear opendlv.sim.KinematicState, as service 'own'") == 1
    own = enter("own")
    pose[1].send(frame(STATE))
    assert (taken(application), taken(*own)) == ([], [STATE])


def test_the_application_reaches_no_service_alone(
    enter: Join, application: Session, capsys: pytest.CaptureFixture[str]
) -> None:
    """Else it could give the vehicle other requests than the recorder and the evaluators see."""
    track = enter("track")
    application.send_directly(frame(READING), [track[0].address])
    application.send_directly(frame("dodo.TestBegin"), [track[0].address])
    assert taken(*track) == []
    runner = enter("dodo-runner")[0]
    runner.send_directly(frame("dodo.TestBegin"), [track[0].address])
    assert taken(*track) == ["dodo.TestBegin"]
