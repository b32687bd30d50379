"""The fork server loads while the command does, and tests are compiled: on another core, it costs no time then.

Only what takes no time to load is imported here.
"""

import argparse
import contextlib
from collections.abc import Iterator, Sequence

from dodo_dsl.run.process.fork_server import ForkServer

_WITHOUT = {"-h", "--help", "docker", "--backend=docker", "host", "--isolation=host"}
"""Words of commands that hardly need one; a test of such a name only begins later."""
_USUAL = ("clock", "rec_recorder", "virtual_camera", "integrator", "dynamic_model", "collision")
"""Services of most tests: which ones they have is known only when they are compiled."""
_ahead: list[ForkServer] = []


def begin(words: Sequence[str]) -> None:
    """Starts one for ``dodo run`` with these words, before its modules are loaded and the words are understood."""
    if not _WITHOUT & set(words):
        server = ForkServer()
        server.load(f"services.{name}" for name in _USUAL)
        _ahead.append(server)


@contextlib.contextmanager
def loading(options: argparse.Namespace) -> Iterator[ForkServer | None]:
    """The one that has begun, or one that starts now, unless the options of ``dodo run`` say that none is needed."""
    server = _ahead.pop() if _ahead else None
    if options.backend != "docker" and options.isolation != "host":
        server = server or ForkServer()
    try:
        yield server
    finally:
        if server is not None:
            server.close()
