"""Where a vehicle was when a picture was taken, from the poses measured before and after it."""

from bisect import bisect_left
from collections import deque
from operator import itemgetter

from dodo_dsl.opendlv.envelope import MICROSECONDS
from services.scene.camera import LONGEST_GAP, CameraPose, motion_between, still

_KEPT = 256
_GAP = round(LONGEST_GAP * MICROSECONDS)

_time = itemgetter(0)


class MeasuredPath:
    """The newest poses by their sample times, in us."""

    def __init__(self) -> None:
        self._poses: deque[tuple[int, CameraPose]] = deque(maxlen=_KEPT)

    def add(self, time: int, pose: CameraPose) -> None:
        """A pose that is not newer than the last one is ignored."""
        if not self._poses or time > self._poses[-1][0]:
            self._poses.append((time, pose))

    @property
    def has_begun(self) -> bool:
        return bool(self._poses)

    def reaches(self, time: int) -> bool:
        return bool(self._poses) and self._poses[-1][0] >= time

    def at(self, time: int) -> CameraPose | None:
        """The pose between those measured around ``time``, or as the last two moved on; None if none is near.

        A pose is near within a second, after which a vehicle may be anywhere.
        """
        after = bisect_left(self._poses, time, key=_time)
        if after == len(self._poses):
            return self._onwards(time)
        later, pose = self._poses[after]
        if later == time:
            return pose
        if after == 0:
            return None
        earlier, before = self._poses[after - 1]
        if later - earlier > _GAP:
            return None
        return motion_between(before, pose, later - earlier).after((time - later) / MICROSECONDS)

    def _onwards(self, time: int) -> CameraPose | None:
        if not self._poses or time - self._poses[-1][0] > _GAP:
            return None
        last, pose = self._poses[-1]
        before = self._poses[-2] if len(self._poses) > 1 else None
        motion = motion_between(before[1], pose, last - before[0]) if before else still(pose)
        return motion.after((time - last) / MICROSECONDS)
