"""The beacon on the bus: poses along a trajectory at a fixed rate."""

import math
from collections.abc import Iterator
from pathlib import Path

from google.protobuf.message import Message

from dodo_dsl.opendlv.assets.trajectory import (
    Trajectory,
    TrajectoryError,
    TrajectoryPose,
    read_points,
    read_table,
    straight,
)
from dodo_dsl.opendlv.envelope import MICROSECONDS
from services.base import Context, Flags, Output, Service, period_of


class Beacon(Service):
    """Stands at the start of its trajectory until the test begins, and then moves along it."""

    def __init__(self, context: Context) -> None:
        flags = context.flags
        self.period = period_of(flags["freq"])
        self.trajectory = trajectory_of(flags)
        self._hold: bool = flags["hold"]
        self._at_once: bool = flags["start"] == "at-once"
        self._started: int | None = None
        self._frame = context.messages.type("opendlv.sim.Frame")
        self._state = context.messages.type("opendlv.sim.KinematicState")
        self._frame_id: int = flags["frame-id"]
        self._state_id: int | None = flags["state-id"]

    def begin(self, now: int) -> None:
        if self._started is None:
            self._started = now

    def update(self, now: int) -> Iterator[Output]:
        if self._at_once:
            self.begin(now)
        elapsed = 0 if self._started is None else now - self._started
        moving = self._started is not None
        pose = self.trajectory.at(elapsed / MICROSECONDS)
        self.finished = moving and not self._hold and elapsed >= self.trajectory.duration * MICROSECONDS
        half = pose.yaw / 2
        frame = self._frame(x=pose.x, y=pose.y, z=pose.z, qz=math.sin(half), qw=math.cos(half))
        yield Output(frame, self._frame_id)
        if self._state_id is not None:
            yield Output(self._motion(pose, moving), self._state_id)

    def _motion(self, pose: TrajectoryPose, moving: bool) -> Message:
        vx, vy, vz = pose.body_velocity
        state: Message = self._state(vx=vx, vy=vy, vz=vz, yawRate=pose.yaw_rate) if moving else self._state()
        return state


def trajectory_of(flags: Flags) -> Trajectory:
    """The trajectory that the flags describe; raises TrajectoryError."""
    named = [f"--{name}" for name in ("path", "points", "length") if flags[name]]
    if len(named) > 1:
        raise TrajectoryError(f"{named[0]} and {named[1]} exclude each other: give one of them")
    height = flags["z"]
    if flags["path"]:
        return Trajectory(read_table(Path(flags["path"]), height), flags["speed"])
    if flags["points"]:
        return Trajectory(read_points(flags["points"], height), flags["speed"])
    yaw = math.radians(flags["yaw"])
    return straight(flags["x"], flags["y"], height, yaw, flags["length"], flags["speed"])


build = Beacon
