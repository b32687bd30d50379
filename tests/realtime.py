"""Real time on a machine that is busy with something else: what is tried must not depend on it."""

import contextlib
import os

_NICE = -15


def hurry(process: int) -> None:
    """A process just started, and what it starts, goes ahead of ordinary ones where this user may have it so."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, process, _NICE)


def wait_for_nobody(process: int) -> None:
    """A process goes ahead of all others, as a rig waits for nobody; it must use little of the processor."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(process, os.SCHED_RR, os.sched_param(1))
