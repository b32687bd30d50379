"""The fork server: a process that has loaded what DoDo's services need, and forks the sandboxes of tests.

Loading numpy, OpenCV and similar takes most of the processor time of a short test's set-up. Sandboxes with their own
namespaces are forked from here; their services are forks of them in turn. The runner's messages name modules to load;
with what a sandbox enters, and descriptors, it is forked.
"""

import contextlib
import gc
import importlib
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import IO

from dodo_dsl.run.process.environment import own_environment
from dodo_dsl.run.process.slot import Entered, package_path

_MAX_MESSAGE, _MAX_DESCRIPTORS = 1 << 16, 64


def python(
    module: str, channel: socket.socket, held: Sequence[int] = (), log: IO[bytes] | int = subprocess.DEVNULL, **own: str
) -> "subprocess.Popen[bytes]":
    """A module of DoDo's as a process that gets a channel, and descriptors to hold."""
    return subprocess.Popen(
        [sys.executable, "-P", "-m", module, str(channel.fileno())],
        pass_fds=(channel.fileno(), *held),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=log,
        start_new_session=True,
        env={**own_environment(), "PYTHONPATH": package_path(), **own},
    )


class ForkServer:
    """The runner's end of a fork server, which ends when this is closed, or with the runner.

    It loads for a second before it serves; what is asked of it meanwhile waits.
    """

    def __init__(self) -> None:
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = python("dodo_dsl.run.process.fork_server", theirs)

    def load(self, modules: Iterable[str]) -> None:
        """Lets the sandboxes to come have loaded these services of DoDo's."""
        self.fork(Entered(0), modules, ())

    def fork(self, entered: Entered, modules: Iterable[str], descriptors: Sequence[int]) -> None:
        """Starts a sandbox that has loaded modules; ``descriptors`` are its end of a channel, its log, and leases."""
        message = [sorted(modules), entered.process, [*map(str, entered.shown)]]
        with contextlib.suppress(OSError):  # it has ended, which a sandbox's channel says
            socket.send_fds(self._socket, [json.dumps(message).encode()], descriptors)

    def close(self) -> None:
        """Ends the fork server; the sandboxes stay."""
        self._socket.close()
        self._process.kill()
        self._process.wait()


_THREADS = "OPENBLAS_NUM_THREADS"
"""By default numpy's linear algebra starts threads when it is imported."""
LOADED = (
    "dodo_dsl.run.process.sandbox",
    "dodo_dsl.opendlv.session",
    "dodo_dsl.opendlv.shared_memory",
    "yaml",
    "numpy",
    "cv2",
    "shapely",
    "pyseccomp",
)
"""What most services import."""


def _import(names: Iterable[str]) -> None:
    """Imports modules without starting threads; those that are not installed are skipped."""
    before = dict(os.environ)
    os.environ[_THREADS] = "1"
    for name in names:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    os.environ.clear()
    os.environ.update(before)  # OpenCV sets some, too, and applications inherit them


def serve(runner: socket.socket) -> None:
    """Loads and forks as the runner says, until it closes the socket."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # the kernel collects the forks
    while True:
        data, descriptors, _, _ = socket.recv_fds(runner, _MAX_MESSAGE, _MAX_DESCRIPTORS)
        if not data:
            return
        modules, process, shown = json.loads(data)
        for module in modules:
            _import([module, f"{module}.__main__"])
            sys.modules.pop(f"{module}.__main__", None)  # it runs as __main__
        gc.freeze()
        if descriptors and os.fork() == 0:
            runner.close()
            os._exit(_sandbox(descriptors[0], descriptors[1], Entered(process, tuple(map(Path, shown)))))
        for descriptor in descriptors:
            os.close(descriptor)


def _sandbox(channel: int, log: int, entered: Entered) -> int:
    """The fork's whole life; its exit code."""
    from dodo_dsl.run.process import sandbox

    gc.enable()
    os.dup2(log, sys.stderr.fileno())
    os.close(log)
    os.setsid()
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    try:
        return sandbox.serve(socket.socket(fileno=channel), entered)
    except BaseException:  # noqa: BLE001  (it is printed as Python does)
        sys.excepthook(*sys.exc_info())
        return 1


def main(argv: list[str]) -> int:
    """``fork_server DESCRIPTOR``: serves the runner at the other end of the descriptor."""
    gc.disable()  # what is loaded now, the garbage collection of the forks leaves alone
    _import(LOADED)
    from dodo_dsl.opendlv.message_set import MessageSet

    MessageSet.standard()
    with contextlib.suppress(OSError):
        serve(socket.socket(fileno=int(argv[0])))
    return 0


if __name__ == "__main__":
    os._exit(main(sys.argv[1:]))  # the interpreter would take apart first what was loaded
