"""The fork server: a process that has loaded what DoDo's services need, and forks the sandboxes of tests.

Loading numpy, OpenCV and similar takes most of the processor time of a short test's set-up. Sandboxes with their own
namespaces are forked from here; their services are forks of them in turn.

    runner to fork server   {"hold": true} with the descriptor of a lease that the forks hold, too;
                            {"load": [module of a service of DoDo's, ...]};
                            {"slot": name, "entered": as the sandbox has it} with the sandbox's end of its channel
                            and its log's descriptor
"""

import contextlib
import gc
import importlib
import json
import os
import signal
import socket
import sys
from collections.abc import Iterable

from dodo_dsl.run.process import sandbox
from dodo_dsl.run.process.slot import SLOT_VARIABLE

MAX_MESSAGE = 1 << 16
_THREADS = "OPENBLAS_NUM_THREADS"
"""By default numpy's linear algebra starts threads when it is imported."""
LOADED = (
    "dodo_dsl.opendlv.session",
    "dodo_dsl.opendlv.shared_memory",
    "yaml",
    "numpy",
    "cv2",
    "shapely",
    "pyseccomp",
)
"""What most services import."""


def load() -> None:
    """Imports what most services need, which the garbage collection of the forks leaves alone."""
    gc.disable()
    _import(LOADED)
    from dodo_dsl.opendlv.message_set import MessageSet

    MessageSet.standard()
    gc.freeze()


def load_services(modules: Iterable[str]) -> None:
    """Imports what these services of DoDo's consist of."""
    for module in modules:
        _import([module, f"{module}.__main__"])
        sys.modules.pop(f"{module}.__main__", None)  # it runs as __main__
    gc.freeze()


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
    """Loads and forks as the runner's messages say, until it closes the socket."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # the kernel collects the forks
    while True:
        data, descriptors, _, _ = socket.recv_fds(runner, MAX_MESSAGE, 2)
        if not data:
            return
        message = json.loads(data)
        if "hold" in message:
            os.set_inheritable(descriptors[0], True)
            continue
        if "load" in message:
            load_services(message["load"])
            continue
        channel, log = descriptors
        if os.fork() == 0:
            os._exit(_sandbox(runner, channel, log, message["slot"], message["entered"]))
        os.close(channel)
        os.close(log)


def _sandbox(runner: socket.socket, channel: int, log: int, slot: str, entered: str) -> int:
    """The fork's whole life; its exit code."""
    runner.close()
    gc.enable()
    os.dup2(log, sys.stderr.fileno())
    os.close(log)
    os.setsid()
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.environ[SLOT_VARIABLE] = slot
    try:
        return sandbox.main([str(channel), entered, "--forks"])
    except BaseException:  # noqa: BLE001  (it is printed as Python does)
        sys.excepthook(*sys.exc_info())
        return 1


def main(argv: list[str]) -> int:
    """``fork_server DESCRIPTOR``: serves the runner at the other end of the descriptor."""
    runner = socket.socket(fileno=int(argv[0]))
    load()
    with contextlib.suppress(OSError):
        serve(runner)
    return 0


if __name__ == "__main__":
    os._exit(main(sys.argv[1:]))  # the interpreter would take apart first what was loaded
