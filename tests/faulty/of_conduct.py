"""Faults of how the application conducts itself on the bus, in time and as a process."""

import sys
import time
from collections.abc import Callable, Iterable
from typing import Any

from tests.faulty.kiwi import Cones, Make, Program, Sent, announcing, finding, framing, numbered, sending

OWN_CID = 111
LATER = 30
LEAK_BYTES, LEAK_FRAMES = 50_000_000, 50


def stamped(stamp: int) -> Make:
    """Another sender stamp than the wiring's."""
    return sending(lambda sent: [(sent[0], sent[1], stamp)])


def at_times(change: Callable[[int | None], int | None]) -> Make:
    """Other sample times (us; None is now)."""
    return sending(lambda sent: [(sent[0], change(sent[1]), sent[2])])


def repeated(times: int) -> Make:
    """Every message many times."""
    return sending(lambda sent: [sent] * times)


def silent_after(messages: int) -> Make:
    """No more messages after the first ones."""
    number = numbered()
    return sending(lambda sent: [sent] if number() < messages else [])


def every_second() -> Make:
    """The messages of every second frame, by their sample time."""
    times: list[int | None] = []

    def change(sent: Sent) -> Iterable[Sent]:
        if sent[1] not in times[-1:]:
            times.append(sent[1])
        return [sent] if len(times) % 2 else []

    return sending(change)


def before() -> Make:
    """Each message of the frame before in place of that of this one, with its sample time."""
    last: dict[str, Sent] = {}

    def change(sent: Sent) -> Iterable[Sent]:
        name = sent[0].DESCRIPTOR.full_name
        held, last[name] = last.get(name, sent), sent
        return [held]

    return sending(change)


def at_nothing(cones: Cones) -> Cones:
    """An exception where no cone was found."""
    if not cones:
        crash()
    return cones


def readings(program: Program) -> None:
    """What the car says of itself, GroundSteeringReading and PedalPositionReading, in place of requests to it."""
    program.REQUESTS = tuple(name.replace("Request", "Reading") for name in program.REQUESTS)


def fixed_cid(program: Program) -> None:
    """The car's own bus, whatever ``--cid`` says."""
    session = program.Session
    program.Session = lambda _cid: session(OWN_CID)


def frame_before() -> Make:
    """Each frame announced as the one before it."""
    times: list[int] = []

    def change(cones: Cones, frame: int, sample_time: int) -> tuple[Cones, int, int]:
        times.append(sample_time)
        return cones, frame, times.pop(0) if len(times) > 1 else sample_time

    return announcing(change)


def at_frame(frame: int, act: Callable[[], None]) -> Make:
    """Something done once, in a frame counted from 0."""
    number = numbered()
    return framing(lambda: act() if number() == frame else None)


def computing(seconds: float) -> Callable[[], None]:
    """Processor time spent, in s."""

    def act() -> None:
        until = time.process_time() + seconds
        while time.process_time() < until:
            pass

    return act


def sleeping(seconds: float) -> Callable[[], None]:
    """Wall time spent, in s."""
    return lambda: time.sleep(seconds)


def leaking() -> Callable[[], None]:
    """50 MB lost in each frame; no more after 2.5 GB, as the machine has others to serve."""
    lost: list[Any] = []

    def act() -> None:
        if len(lost) < LEAK_FRAMES:
            lost.append(bytearray(b"x") * LEAK_BYTES)

    return act


def crash() -> None:
    """An exception that nobody catches."""
    raise RuntimeError("the example has a fault here")


def crash_at_start(program: Program) -> None:
    """An exception before anything else."""
    program.main = crash


def ends(code: int) -> Callable[[], None]:
    """The program's end with an exit code."""
    return lambda: sys.exit(code)


PERCEPTION_CONDUCT: dict[str, Make] = {
    "sample-time-now": at_times(lambda _: None),
    "sample-time-zero": at_times(lambda _: 0),
    "sample-time-before": frame_before(),
    "stamp-perception": stamped(7),
    "fixed-cid": fixed_cid,
    "slow-computing": framing(computing(0.5)),
    "slow-sleeping": framing(sleeping(0.5)),
    "leaks": framing(leaking()),
    "ends-0": at_frame(LATER, ends(0)),
    "ends-1": at_frame(LATER, ends(1)),
    "crashes-at-start": crash_at_start,
    "crashes-at-first": at_frame(0, crash),
    "crashes-at-nothing": finding(at_nothing),
}
STEERING_CONDUCT: dict[str, Make] = {
    "stamp-steering": stamped(7),
    "wrong-message": readings,
    "fixed-cid": fixed_cid,
    "silent": silent_after(0),
    "silent-later": silent_after(2 * LATER),
    "floods": repeated(200),
    "every-second": every_second(),
    "answer-before": before(),
    "crashes-later": at_frame(LATER, crash),
}
