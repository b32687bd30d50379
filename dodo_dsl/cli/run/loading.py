"""The fork server loads while tests are compiled: on another core, it costs no time then."""

import argparse
import contextlib
from collections.abc import Iterator
from dataclasses import dataclass

from dodo_dsl.run.process.fork_server_client import ForkServer


@dataclass
class Loading:
    """A fork server until a backend takes it; ``descriptor`` is that of a lease which its sandboxes hold, too."""

    descriptor: int
    fork_server: ForkServer | None

    def take(self) -> ForkServer | None:
        taken, self.fork_server = self.fork_server, None
        return taken


@contextlib.contextmanager
def loading(options: argparse.Namespace, descriptor: int) -> Iterator[Loading]:
    """Starts one unless the options of ``dodo run`` say that none is needed; one that nobody took ends."""
    is_needed = options.backend != "docker" and options.isolation != "host"
    load = Loading(descriptor, ForkServer((descriptor,)) if is_needed else None)
    try:
        yield load
    finally:
        if left := load.take():
            left.kill()
