"""Says when two runs write into one report's folder."""

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO


@contextlib.contextmanager
def reserved(folder: Path, stdout: TextIO) -> Iterator[None]:
    """Holds the folder, as long as this process lives at most; says so when another run holds it already.

    Both go on: their tests have folders of their own there, and the pages and results are those of the later end.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        if not _locked(descriptor):
            stdout.write(f"note: another run writes into '{folder}', too, and the report will be of the last to end; ")
            stdout.write("--report names another folder\n")
        yield
    finally:
        os.close(descriptor)


def _locked(descriptor: int) -> bool:
    """Whether nobody else holds the lock; True as well on file systems without locks."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True
