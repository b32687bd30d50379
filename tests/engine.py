"""A Docker engine that is stuck: it answers, but one of its containers holds a lock for ever.

It happened once on a busy machine, after a container's start that never came back; the cause is not known. A test that
such an engine kept waiting has another try, with the engine started anew, and only then.
"""

import contextlib
import os
import signal
import subprocess
from pathlib import Path

LIMIT_S = 400
STUCK = ["Read timed out", "TimeoutExpired", "from pytest-timeout"]
"""What the failure of a test that waited for the engine says."""
_ANSWER_S = 60
_ROOT = Path(__file__).parents[1]
_PID, _LOCK = Path("/run/dodo-engine/dockerd.pid"), Path("/var/run/docker.pid")
"""Of an engine that scripts/start-engine started and may start again; and of any."""


def is_stuck() -> bool:
    """Whether the engine keeps silent about one of its containers."""
    with contextlib.suppress(FileNotFoundError):
        try:
            listed = subprocess.run(
                ["docker", "ps", "-aq"], capture_output=True, text=True, check=False, timeout=_ANSWER_S
            )
            words = ["docker", "inspect", *listed.stdout.split()]
            subprocess.run(words, capture_output=True, check=False, timeout=_ANSWER_S)
        except subprocess.TimeoutExpired:
            return True
    return False


def start_anew() -> bool:
    """Ends a stuck engine and what it started, and starts it again; False where it is somebody else's."""
    if not _PID.is_file():
        return False
    with contextlib.suppress(ProcessLookupError):
        os.kill(int(_PID.read_text()), signal.SIGKILL)
    subprocess.run(["pkill", "-KILL", "-f", "containerd.*/var/run/docker/"], check=False)
    for path in (_PID, _LOCK):
        path.unlink(missing_ok=True)
    subprocess.run([_ROOT / "scripts" / "start-engine"], check=True)
    return True
