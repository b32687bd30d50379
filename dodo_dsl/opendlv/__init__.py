"""OpenDLV as libcluon 0.0.149 speaks it: messages, the bus, shared memory and recordings.

What applications in Python import from here is stable; the modules below are DoDo's own, and may move.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dodo_dsl.opendlv.envelope import Envelope
    from dodo_dsl.opendlv.message_set import MessageSet
    from dodo_dsl.opendlv.recording import Recording
    from dodo_dsl.opendlv.recording_writer import RecordingWriter
    from dodo_dsl.opendlv.session import Session
    from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError

__all__ = ["Envelope", "MessageSet", "Recording", "RecordingWriter", "Session", "SharedMemory", "SharedMemoryError"]
_MODULES = {
    "Envelope": "envelope",
    "MessageSet": "message_set",
    "Recording": "recording",
    "RecordingWriter": "recording_writer",
    "Session": "session",
    "SharedMemory": "shared_memory",
    "SharedMemoryError": "shared_memory",
}


def __getattr__(name: str) -> Any:
    """Loads what is asked for, and nothing else: DoDo's commands would wait for all of it."""
    if name not in _MODULES:
        raise AttributeError(f"module '{__name__}' has no '{name}'")
    return getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)
