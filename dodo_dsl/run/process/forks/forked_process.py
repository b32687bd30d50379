"""A Python module as a process that is forked instead of started: it has what its parent has loaded already."""

import os
import runpy
import signal
import sys
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NoReturn

_DESCRIPTORS = 65_536


class ForkedModule:
    """A child of this process, which has one thread; ``pid`` is that of its own session."""

    def __init__(self, words: Sequence[str], environment: Mapping[str, str], folder: str, output: int) -> None:
        """``words`` are ``python -m MODULE`` and its arguments; raises OSError when the folder cannot be entered."""
        Path(folder).stat()
        sys.stderr.flush()
        self.pid = os.fork()
        if self.pid == 0:
            _become(words, environment, folder, output)

    def wait(self) -> int:
        """Its exit code, below 0 for the signal that ended it, as in subprocess."""
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


def _become(words: Sequence[str], environment: Mapping[str, str], folder: str, output: int) -> NoReturn:
    code = 1
    try:
        _set_up(environment, folder, output)
        sys.argv[:] = words[2:]
        runpy.run_module(words[2], run_name="__main__", alter_sys=True)
        code = 0
    except SystemExit as end:
        code = _exit_code(end)
    except BaseException:  # noqa: BLE001  (it is printed as Python does)
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(code & 0xFF)


def _set_up(environment: Mapping[str, str], folder: str, output: int) -> None:
    """Session, signals, descriptors, variables and folder as those of a started program."""
    os.setsid()
    signal.set_wakeup_fd(-1)
    for caught in (signal.SIGCHLD, signal.SIGTERM):
        signal.signal(caught, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    no_input = os.open(os.devnull, os.O_RDONLY)
    for number, target in enumerate((no_input, output, output)):
        os.dup2(target, number)
    os.closerange(3, _DESCRIPTORS)
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    sys.stdin = open(0, closefd=False)  # noqa: SIM115
    sys.stdout = open(1, "w", buffering=1, closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", buffering=1, closefd=False)  # noqa: SIM115


def _exit_code(end: SystemExit) -> int:
    if end.code is None:
        return 0
    if isinstance(end.code, int):
        return end.code
    print(end.code, file=sys.stderr)
    return 1
