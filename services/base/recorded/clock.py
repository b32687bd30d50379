"""The clock for a recording: its steps where it has them, else its messages by when they were received."""

from pathlib import Path

from dodo_dsl.opendlv.bus.session import Session
from services.base.clock import Clock
from services.base.lockstep.lockstep_clock import LockstepClock
from services.base.recorded.recorded_steps import RecordedSteps, read_steps
from services.base.recorded.recording_clock import RecordingClock


def clock_of(recording: Path, session: Session, role: str) -> Clock:
    """For the service ``role``; raises OSError for a file that cannot be read."""
    if next(read_steps(recording, session.messages), None) is None:
        return RecordingClock(recording, session.messages)
    return LockstepClock(session, role, 1, RecordedSteps(recording, session.messages))
