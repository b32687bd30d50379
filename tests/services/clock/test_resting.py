"""An application whose own time is the test's, by an agent of the tests over real FIFOs."""

import json
import os
import struct
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory
from services.base.lockstep_clock import EPOCH
from services.clock import exchange, resting
from services.clock.agent import TimeAgent
from services.clock.answers import filters
from services.clock.exchange import ApplicationFails, Exchange, ServiceSilent
from services.clock.printed_lines import PrintedLines
from services.clock.resting import ResponseTimes, RestingApplication
from tests.services.clock.toys import STEER, STEP, Toys

Answer = Callable[[int], list[object]]
"""What an agent replies when the application is to go on to a time (us); bytes as they are."""


def reached(until: int, **more: object) -> dict[str, object]:
    return {"now": until * 1000, "services": [0, 1], "notes": [], "repeatable": True, **more}


@contextmanager
def agent(folder: Path, answer: Answer = lambda until: [reached(until)]) -> Iterator[TimeAgent]:
    folder.mkdir(exist_ok=True)
    for name in ("command", "reply"):
        os.mkfifo(folder / name, 0o600)
    command = os.open(folder / "command", os.O_RDWR)
    reply = os.open(folder / "reply", os.O_RDWR)

    def serve() -> None:
        with os.fdopen(command, "rb", buffering=0) as lines:
            for line in iter(lines.readline, b"end\n"):
                for each in answer(int(line.split()[1]) // 1000) if line != b"mine\n" else ():
                    os.write(reply, each if isinstance(each, bytes) else json.dumps(each).encode() + b"\n")
        os.close(reply)

    thread = threading.Thread(target=serve)
    thread.start()
    made = TimeAgent(folder)
    try:
        made.open()
        yield made
    finally:
        if thread.is_alive():
            (folder / "command").write_text("end\n")
        thread.join()
        made.close()


class Link:
    """Nobody else is on the bus."""

    def __init__(self, on_drain: Callable[[], None] = lambda: None) -> None:
        self.drain = on_drain
        self.sent: list[Any] = []

    def send(self, service: str, command: Any) -> None:
        self.sent.append((service, command))

    def stopped(self) -> bool:
        return False

    def results(self, services: list[str]) -> Any:
        return []

    def __getattr__(self, _name: str) -> Callable[..., None]:
        return lambda *_, **__: None


MESSAGES = MessageSet.standard()


def steering(sent: int, sampled: int = 5, stamp: int = 0) -> Envelope:
    return Envelope(MESSAGES.id(STEER), b"", sent, 1, sampled, stamp)


def application(agent: TimeAgent, link: object = None, lines: object = None) -> RestingApplication:
    heard, known = filters([f"{STEER}/0"], MESSAGES), cast(Exchange, link or Link())
    return RestingApplication(known, heard, agent, ResponseTimes(), ("driver", "eye"), cast(PrintedLines, lines))


def test_messages_count_when_they_were_sent_and_no_later_than_now(tmp_path: Path) -> None:
    waiting = [steering(EPOCH - 9)]

    def drain() -> None:
        while waiting:
            driven.take(waiting.pop(0))

    def answer(until: int) -> list[object]:
        if until > EPOCH + resting.EXPOSED_US:
            waiting.extend(steering(EPOCH + at, stamp=stamp) for at, stamp in ((-5, 0), (7, 0), (7, 3), (10**9, 0)))
            waiting.append(steering(EPOCH)._replace(data_type=MESSAGES.id("opendlv.proxy.PedalPositionRequest")))
        return [reached(until)]

    with agent(tmp_path, answer) as time:
        driven = application(time, Link(drain))
        driven.start(EPOCH, ())
        assert not waiting
        driven.show((), EPOCH)
        driven.await_answer(EPOCH + STEP)
        taken = [(e.received - EPOCH, e.sample_time, e.sender_stamp) for e in driven.collect()]
    assert taken == [(1, 5, 0), (1, 5, 0), (8, 5, 0), (8, 5, 3), (STEP, 5, 0)], "what it sent as it started, too"
    assert driven.collect() == []


@pytest.mark.parametrize(
    ("frame", "report", "sentence"),
    [
        (1, {"processor_s": 0.5, "wall_s": 0.5}, "thread 'loop' of service 'eye' computed for 0.4 s without waiting; "),
        (1, {"processor_s": 0.3, "wall_s": 0.5}, ""),
        (2, {"processor_s": 0.3, "wall_s": 0.3}, "thread 'loop' of service 'eye' computed for 0.2 s without waiting; "),
        (2, {"processor_s": 0.3, "state": "W"}, "went on and waited again and again in 0.2 s of computing"),
        (2, {"processor_s": 0.0, "wall_s": 2.5}, "did not wait within 2 s of wall time (state D); in lockstep"),
        (2, {"processor_s": 0.0, "wall_s": 1.5}, ""),
        (2, {"processor_s": "x", "wall_s": 9.0}, ""),
        (2, {"processor_s": 9.0, "wall_s": -1}, ""),
    ],
)
def test_who_does_not_wait_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, frame: int, report: dict[str, Any], sentence: str
) -> None:
    monkeypatch.setattr(exchange, "FIRST_PATIENCE", 0.4)
    monkeypatch.setattr(exchange, "PATIENCE", 0.2)
    busy = {"service": 1, "pid": 12, "tid": 13, "name": "loop", "state": "D", **report}
    steps = iter(range(9))

    def answer(until: int) -> list[object]:
        return [*([{"busy": busy}] if next(steps) == (frame - 1) * 2 + 1 else []), reached(until)]

    with agent(tmp_path, answer) as time:
        driven = application(time)

        def drive() -> None:
            driven.start(EPOCH, ())
            for step in range(frame):
                driven.show((), EPOCH + step * STEP)
                driven.await_answer(EPOCH + (step + 1) * STEP)

        if not sentence:
            drive()
            return
        with pytest.raises(ApplicationFails) as refused:
            drive()
    assert sentence in str(refused.value)


def test_it_goes_on_only_when_the_time_is_reached(tmp_path: Path) -> None:
    """Whatever else the agent, or a stranger, says meanwhile."""
    noise = [b"{}\n[]\n\xff\nnull\n" + b"[" * 5000 + b"\n", {"now": "1"}, {"busy": 3}, reached(EPOCH - 1), b"{"]
    with agent(tmp_path, lambda until: [*noise, b"\n", reached(until), reached(until)]) as time:
        driven = application(time)
        driven.start(EPOCH, ())
        for step in range(3):
            driven.show((), EPOCH + step * STEP)
            driven.await_answer(EPOCH + (step + 1) * STEP)
    assert driven.frames == 3


def test_its_lines_are_of_the_test_from_the_start_on(tmp_path: Path) -> None:
    """Until it is asked the first time, the runner sends them at the machine's time."""
    asked: list[int] = []

    def are_complete(now: int, _: object) -> bool:
        asked.append(now)
        return True

    with agent(tmp_path) as time:
        driven = application(time, lines=SimpleNamespace(are_complete=are_complete))
        driven.start(EPOCH, ())
        assert asked == [EPOCH]
        driven.show((), EPOCH)
        driven.await_answer(EPOCH + STEP)
    assert asked == [EPOCH, EPOCH]


def test_a_destroyed_page_fails_the_application_and_an_agent_that_ends_does_not(tmp_path: Path) -> None:
    with agent(tmp_path, lambda _: [{"destroyed": True}]) as time:
        with pytest.raises(ApplicationFails, match="the application destroyed the page"):
            application(time).start(EPOCH, ())
        (tmp_path / "command").write_text("end\n")
        with pytest.raises(ServiceSilent, match="has ended"):
            while True:
                time.report(0.1)


def test_what_is_computed_for_each_answer_is_measured(tmp_path: Path) -> None:
    """By the agent; by the wall clock where a process has ended, whose last part is not known."""
    ran = iter([(0.5, False), (0.0, False), (0.0, False), *[(1e-6, False)] * 2, (9.0, False), (0.0, True)])

    def answer(until: int) -> list[object]:
        seconds, has_ended = next(ran)
        return [reached(until, ran_s=seconds, has_ended=has_ended)]

    with agent(tmp_path, answer) as time:
        driven = application(time)
        driven.start(EPOCH, ())
        for step in range(3):
            driven.show((), EPOCH + step * STEP)
            driven.take(steering(EPOCH + step * STEP))
            driven.await_answer(EPOCH + (step + 1) * STEP)
            driven.collect()
    facts = driven.facts()
    assert (facts["answers"], facts["worst_frame"], facts["uncopied"]) == (2, 3, 2)
    assert 1e-6 < facts["worst_s"] < 9.0, "no more than passed on the wall"


class Cameras(Link):
    """Their pictures are awaited from the n-th time on at which they are asked."""

    def __init__(self, **awaited: int) -> None:
        super().__init__()
        self._awaited, self._asked = awaited, Counter[str]()

    def results(self, services: list[str]) -> Any:
        self._asked.update(services)
        return [SimpleNamespace(service=name, awaited=self._asked[name] >= self._awaited[name]) for name in services]


def test_the_first_picture_of_a_camera_is_shown_when_the_application_waits_for_it(tmp_path: Path) -> None:
    times, shown = [], [SimpleNamespace(service=name, sampled=EPOCH) for name in ("left", "right")]
    with agent(tmp_path, lambda until: [times.append(until), reached(until)][1:]) as time:
        driven = application(time, link=(link := Cameras(left=1, right=3)))
        driven.start(EPOCH, ("left", "right"))
        for step in range(2):
            driven.show(cast(Any, shown), EPOCH + step * STEP)
            driven.await_answer(EPOCH + (step + 1) * STEP)
    after = {EPOCH + resting.LOOK_US, EPOCH + 2 * resting.LOOK_US}
    shows = {EPOCH + resting.EXPOSED_US, EPOCH + STEP + resting.EXPOSED_US}
    assert {*times} == {EPOCH, EPOCH + STEP, EPOCH + 2 * STEP} | shows | after
    assert [service for service, show in link.sent if show.announces] == ["left", "right", "left", "right"]


def expected(steps: int, every: int) -> list[tuple[int, float]]:
    """The way of a mover that is steered each ``every`` us by the last picture that was shown before."""
    place, speed, way, seen, shown = 0.01, 1.0, [(0, 0.01)], 0.0, 0.01
    for now in range(STEP // 10, (steps - 1) * STEP + 1, STEP // 10):
        if (now - STEP // 10) % every == 0:
            speed = 1.5 - seen
        seen = shown
        place += speed * 0.01
        way.append((now, place))
        if now % STEP == 0:
            shown = place
    return way


def test_the_way_of_one_who_acts_by_a_timer_is_as_computed_by_hand(tmp_path: Path, cid: int) -> None:
    """Also what it sends at the time of a frame, which counts from then on."""
    every = 3 * STEP // 10
    toys = Toys(cid, readers=0, seconds=1.0)
    went, sent = [EPOCH], cast(list[int], [])
    with Session(cid) as session:
        request = session.messages.type(STEER)

        def answer(until: int) -> list[object]:
            while (heard := session.receive(0.0)) is not None:
                sent.append(heard.sent - EPOCH)
            if until > went[-1]:
                with SharedMemory.attach(toys.memory_name) as memory, memory.lock():
                    (place,) = struct.unpack("<d", memory.buffer[:8])
                for now in range(went[-1], until):
                    if (now - EPOCH) % every == 0:
                        payload = session.messages.encode(request(groundSteering=1.5 - place))
                        session.send_envelope(Envelope(MESSAGES.id(STEER), payload, now, 0, 0, 0))
                went.append(until)
            return [reached(until, services=[0])]

        with agent(tmp_path, answer) as time:
            toys.agent = time
            way, stepper = toys.run()
    assert [(at, round(place, 4)) for at, place in way] == [(at, round(x, 4)) for at, x in expected(11, every)]
    assert stepper.application.frames == 11
    places = [at for at in sent if 0 <= at <= 11 * STEP]
    assert places == [at for at, _ in way][: len(places)], "services send at the test's time, too"
    assert len(places) > 50
