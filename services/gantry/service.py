"""The gantry on the bus: hears how the vehicle moves, moves the rig so, and says where the rig is."""

import math
from collections.abc import Iterator
from typing import Any

from google.protobuf.message import Message

from services.base import Context, Flags, Output, Service, period_of
from services.base.signals import interruptible
from services.gantry import start
from services.gantry.emulated import EmulatedRig
from services.gantry.link import Link, RigError
from services.gantry.motion import Limits, Shaper, Velocity, box
from services.gantry.port import PortError, SerialPort, checked
from services.gantry.protocol import SENTENCES, Position, Status, Word, command

EMULATED = "emulated"
MICROSECONDS = 1_000_000
STALE = 500_000
"""us without a kinematic state after which the vehicle counts as standing."""
TRUTH_PERIOD = 10_000
"""us between two messages of where an emulated rig truly is."""
LOST = 300_000
"""us without a measured position after which the rig is not moved on."""


class Gantry(Service):
    """Sends RUN at its rate, as the rig brakes after 500 ms without, and asks for position and status each time."""

    period: int

    def __init__(self, context: Context, link: Link, emulated: EmulatedRig | None = None) -> None:
        flags = context.flags
        self._log = context.log
        self._turn = round(period_of(flags["freq"]))
        self._emulated = emulated
        self.period = min(self._turn, TRUTH_PERIOD) if emulated else self._turn
        self._due = 0
        self.shaper = Shaper(limits_of(flags))
        self.link = link
        self.ended = False
        self._patience = min(0.4 * self._turn / MICROSECONDS, 0.05)
        self._state, self._age, self._rejected = Velocity(), STALE, 0
        self._at: Position | None = None
        self._blind = 0
        self._status: Status | None = None
        self._origin = flags["origin-x"], flags["origin-y"], math.radians(flags["origin-yaw"])
        self._frame = context.messages.type("opendlv.sim.Frame")
        self._report = context.messages.type("opendlv.system.SystemStatusMessage")
        self._frame_id, self._status_id, self._truth_id = (flags[f"{name}-id"] for name in ("frame", "status", "truth"))
        self.inputs = {("opendlv.sim.KinematicState", self._frame_id): self._feed}

    def update(self, now: int) -> Iterator[Output]:
        if now >= self._due:
            self._due = max(self._due + self._turn, now + self._turn // 2)
            yield from self._exchange()
        true = self._emulated.position() if self._emulated else None
        if true is not None and self._truth_id is not None:
            yield Output(self._where(true), self._truth_id)

    def _exchange(self) -> Iterator[Output]:
        at, status = self.link.exchange(self._command() + start.ASKING, self._patience)
        self._age += self._turn
        self._at, self._blind = (self._at, self._blind + self._turn) if at is None else (at, 0)
        if status is not None:
            self._judge(status)
            if status != self._status and self._status_id is not None:
                yield Output(self._report(code=int(status), description=describe(status)), self._status_id)
            self._status = status
        if at is not None:
            yield Output(self._where(at), self._frame_id)

    def begin(self, now: int) -> None:
        if self._emulated:
            self._emulated.watch()

    def end_of_input(self, now: int) -> None:
        self.ended = True

    def _command(self) -> bytes:
        if self.ended or self._at is None or self._blind > LOST:
            self.shaper.halt()
            return command(Word.STOP)
        body = self._state if self._age <= STALE else Velocity()
        cut = self.shaper.cut
        told = self.shaper.step(body, self._at, self._turn / MICROSECONDS)
        if self.shaper.cut == 1 and not cut:
            self._log.warning("the vehicle drives to the edge of the rig, which stops there: %s", place(self._at))
        return command(Word.RUN, told.x, told.y, told.yaw)

    def _judge(self, status: Status) -> None:
        if status not in SENTENCES or (status == Status.WATCHDOG and self.link.fresh):
            return
        where = f", {place(self._at)}" if self._at else ""
        raise RigError(f"the rig at {self.link.name} {SENTENCES[status]}{where} (status {int(status)})")

    def _where(self, at: Position) -> Message:
        x, y, yaw = self._origin
        c, s, half = math.cos(yaw), math.sin(yaw), (yaw + at.yaw) / 2
        x, y = x + c * at.x - s * at.y, y + s * at.x + c * at.y
        frame: Message = self._frame(x=x, y=y, qz=math.sin(half), qw=math.cos(half))
        return frame

    def _feed(self, state: Any, _sample_time: int) -> None:
        velocity = Velocity(state.vx, state.vy, state.yawRate)
        if all(map(math.isfinite, (velocity.x, velocity.y, velocity.yaw))):
            self._state, self._age = velocity, 0
            return
        self._rejected += 1
        if self._rejected == 1:
            self._log.warning("a KinematicState of %s is ignored, as all that are not finite will be", velocity)


def place(at: Position) -> str:
    """A position as it stands in sentences."""
    return f"at x = {at.x:.3f} m, y = {at.y:.3f} m, yaw = {math.degrees(at.yaw):.1f} degrees"


def describe(status: Status) -> str:
    """A status as it stands in messages."""
    return f"the rig {SENTENCES[status]}" if status in SENTENCES else f"the rig is {status.name.lower()}"


def limits_of(flags: Flags) -> Limits:
    """The rig's limits, or tighter ones."""
    low, high = box(flags["range-x"], flags["range-y"], math.radians(flags["range-yaw"]))
    return Limits(
        speed=flags["max-speed"],
        acceleration=flags["max-acceleration"],
        yaw_rate=flags["max-yaw-rate"],
        yaw_acceleration=flags["max-yaw-acceleration"],
        low=low,
        high=high,
    )


def build(context: Context) -> Service:
    """The service from its flags: it is ready when the rig is at its start, and stops the rig on every way out."""
    flags = context.flags
    emulated = context.resources.enter_context(EmulatedRig()) if flags["serial"] == EMULATED else None
    target = checked(emulated.port if emulated else flags["serial"])
    goal = Position(flags["x"], flags["y"], math.radians(flags["yaw"]))
    if not limits_of(flags).holds(goal):
        raise PortError(f"the start is out of the rig's ranges: {place(goal)}")
    link = Link(target, lambda: SerialPort(target))
    context.resources.callback(link.close)
    with interruptible():
        status = start.find(link)
        if flags["calibrate"] or emulated:
            start.calibrate(link, flags["patience"])
        elif status in SENTENCES and status != Status.WATCHDOG:
            hint = "; --calibrate lets it find its home" if status == Status.NOT_CALIBRATED else ""
            raise PortError(f"the rig at {target} {SENTENCES[status]} (status {int(status)}){hint}")
        start.go(link, goal, flags["patience"])
    return Gantry(context, link, emulated)
