"""The gantry on the bus: moves the rig as the vehicle moves, and publishes the rig's position."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

from google.protobuf.message import Message

from services.base import Context, Flags, Output, Service, period_of
from services.base.process import interruptible
from services.gantry import memory, start
from services.gantry.emulator import EmulatedRig
from services.gantry.link import REQUEST_STATE, Link, PortError, RigError, checked
from services.gantry.memory import conversion_of, kept_limits, motion_limits
from services.gantry.motion import Shaper, Velocity
from services.gantry.protocol import SENTENCES, Position, Refusal, Word, command
from services.gantry.rig_table import Status

EMULATED = "emulated"
MICROSECONDS = 1_000_000
STALE, SILENT = 0.45, 1.0
"""s without a kinematic state after which the vehicle counts as standing, and after which its source counts as lost."""
RUNNER_SILENT = 3.0
"""s without a sign of life of the runner, after the first one, after which it counts as killed."""
TRUTH_PERIOD = 10_000
"""us between two messages with the true position of an emulated rig."""
LOST = 300_000
"""us without a measured position after which the rig is not moved on."""


class Gantry(Service):
    """Sends RUN at its rate, as the rig brakes after 500 ms without, and requests position and status each time."""

    period: int

    def __init__(
        self,
        context: Context,
        link: Link,
        emulated: EmulatedRig | None = None,
        wall: Callable[[], float] = time.monotonic,
    ) -> None:
        """``wall`` in s: a peer that hangs is noticed in real time."""
        flags = context.flags
        self._wall = wall
        self._log = context.log
        self._turn = round(period_of(flags["freq"]))
        self._emulated = emulated
        self.period = min(self._turn, TRUTH_PERIOD) if emulated else self._turn
        self._due = 0
        self.shaper = Shaper(motion_limits(flags))
        self.link = link
        self.ended = False
        self._patience = min(0.4 * self._turn / MICROSECONDS, 0.05)
        self._state = Velocity()
        self._last_state: float | None = None
        self._alive: float | None = None
        self._alive_time = 0
        self._at: Position | None = None
        self._blind = 0
        self._moved = False
        self._status: Status | None = None
        self._origin = flags["origin-x"], flags["origin-y"], math.radians(flags["origin-yaw"])
        self._frame = context.messages.type("opendlv.sim.Frame")
        self._report = context.messages.type("opendlv.system.SystemStatusMessage")
        self._frame_id, self._status_id, self._truth_id = (flags[f"{name}-id"] for name in ("frame", "status", "truth"))
        self.inputs = {
            ("opendlv.sim.KinematicState", self._frame_id): self._take_state,
            ("dodo.Alive", None): self._take_sign_of_life,
        }

    def update(self, now: int) -> Iterator[Output]:
        if now >= self._due:
            self._due = max(self._due + self._turn, now + self._turn // 2)
            yield from self._exchange()
        true = None
        if self._emulated:
            true, self.paused = self._emulated.position(), self._emulated.paused
        if true is not None and self._truth_id is not None:
            yield Output(self._where(true), self._truth_id)

    def _exchange(self) -> Iterator[Output]:
        self._supervise()
        at, status, refusals, *_ = self.link.exchange(self._command() + REQUEST_STATE, self._patience)
        self._at, self._blind = (self._at, self._blind + self._turn) if at is None else (at, 0)
        if status is not None:
            self._check(status)
            if status != self._status and self._status_id is not None:
                yield Output(self._report(code=int(status), description=describe(status)), self._status_id)
            self._status = status
        self._check_refusals(refusals)
        if at is not None:
            yield Output(self._where(at), self._frame_id)

    def begin(self, now: int) -> None:
        if self._emulated:
            self._emulated.watch()

    def end_of_input(self, now: int) -> None:
        self.ended = True

    def _command(self) -> bytes:
        """RUN, or STOP once, after any fault was read: STOP acknowledges it."""
        if self.ended or self._at is None or self._blind > LOST:
            self.shaper.halt()
            moved, self._moved = self._moved, False
            return command(Word.STOP) if moved else b""
        self._moved = True
        body = self._state if self._age(self._last_state) <= STALE else Velocity()
        cut = self.shaper.cut
        velocity = self.shaper.step(body, self._at, self._turn / MICROSECONDS)
        if self.shaper.cut == 1 and not cut:
            self._log.warning("the vehicle drives to the edge of the rig, where the rig stops: %s", place(self._at))
        return command(Word.RUN, *self.link.conversion.velocity(velocity.x, velocity.y, velocity.yaw))

    def _age(self, since: float | None) -> float:
        return math.inf if since is None else self._wall() - since

    def _supervise(self) -> None:
        """Raises RigError when the source of kinematic states or the runner hangs or is gone."""
        if self._last_state is not None and not self.ended and self._age(self._last_state) > SILENT:
            raise RigError(f"no KinematicState of the vehicle has come for {SILENT:g} s, and they came before")
        if self._alive is not None and self._age(self._alive) > RUNNER_SILENT:
            raise RigError(f"the runner has given no sign of life for {RUNNER_SILENT:g} s")

    def _check(self, status: Status) -> None:
        if status in SENTENCES:
            where = f", {place(self._at)}" if self._at else ""
            raise RigError(f"the rig at {self.link.name} {SENTENCES[status]}{where} (status {int(status)})")

    def _check_refusals(self, refusals: tuple[Refusal, ...]) -> None:
        """A damaged line is repeated soon; any other refusal means that the rig is in a wrong state."""
        for refusal in refusals:
            if not refusal.is_garbled:
                raise RigError(f"the rig at {self.link.name} refuses to move: {refusal}")
            self._log.warning("the rig at %s received a damaged line: %s", self.link.name, refusal)

    def _where(self, at: Position) -> Message:
        x, y, yaw = self._origin
        c, s, half = math.cos(yaw), math.sin(yaw), (yaw + at.yaw) / 2
        x, y = x + c * at.x - s * at.y, y + s * at.x + c * at.y
        frame: Message = self._frame(x=x, y=y, qz=math.sin(half), qw=math.cos(half))
        return frame

    def _take_state(self, state: Any, _sample_time: int) -> None:
        velocity = Velocity(state.vx, state.vy, state.yawRate)
        if all(map(math.isfinite, (velocity.x, velocity.y, velocity.yaw))):
            self._state, self._last_state = velocity, self._wall()
            return
        self._log.warning("ignored a KinematicState of %s", velocity)

    def _take_sign_of_life(self, message: Any, _sample_time: int) -> None:
        """One that somebody repeats says nothing of the runner."""
        if message.time > self._alive_time:
            self._alive_time, self._alive = message.time, self._wall()


def place(at: Position) -> str:
    return f"at x = {at.x:.3f} m, y = {at.y:.3f} m, yaw = {math.degrees(at.yaw):.1f} degrees"


def describe(status: Status) -> str:
    return f"the rig {SENTENCES[status]}" if status in SENTENCES else f"the rig is {status.name.lower()}"


def opened(flags: Flags, resources: ExitStack) -> tuple[Link, EmulatedRig | None]:
    """The line to the rig, which it stops when closed, and the emulated rig; raises PortError and RigError."""
    emulated = resources.enter_context(EmulatedRig(kind=flags["kind"])) if flags["serial"] == EMULATED else None
    link = Link(checked(emulated.port if emulated else flags["serial"]), conversion=conversion_of(flags))
    resources.callback(link.close)
    return link, emulated


def build(context: Context) -> Service:
    """The service from its flags: it is ready when the rig is at its start, and stops the rig at every exit."""
    flags = context.flags
    goal = Position(flags["x"], flags["y"], math.radians(flags["yaw"]))
    if not motion_limits(flags).holds(goal):
        raise PortError(f"the start is out of the rig's ranges: {place(goal)}")
    link, emulated = opened(flags, context.resources)
    with interruptible():
        status = start.find(link)
        start.settle(link, status)
        calibrates = bool(flags["calibrate"] or emulated)
        memory.agree(link, kept_limits(flags), write=calibrates)
        if calibrates:
            start.calibrate(link, flags["patience"])
        elif status == Status.NOT_CALIBRATED:
            raise PortError(f"{start.trouble(link, status)}; --calibrate makes it find its home")
        start.go(link, goal, flags["patience"])
    return Gantry(context, link, emulated)
