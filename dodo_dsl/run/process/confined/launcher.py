"""Gives an application's program its environment only when it is confined and has given up root.

Variables such as LD_PRELOAD and PATH would otherwise act on the programs that confine it. They come by a file without a
name, as everybody on the machine can read words of a command line.
"""

import os
import sys
from collections.abc import Mapping

PROGRAM = """
import errno, os, sys
source, began, program, *words = sys.argv[1:]
began = int(began)
os.set_inheritable(began, False)
with open(int(source), "rb") as file:
    environment = dict(item.split(b"=", 1) for item in file.read().split(b"\\0") if item)
os.write(began, b"+")
try:
    try:
        os.execve(program, words, environment)
    except OSError as error:
        if error.errno != errno.ENOEXEC:
            raise
        os.execve("/bin/sh", ["sh", program, *words[1:]], environment)
except OSError as error:
    os.write(began, b"-")
    sys.exit(f"{program}: {error.strerror}")
"""

BEGAN = b"+"


def words(source: int, began: int, program: str) -> list[str]:
    """The words before the application's own, the name of its program among them; ``source`` is of ``variables``.

    ``began`` is a descriptor that gets ``BEGAN`` when all is prepared, and more when the program cannot be started.
    """
    return [sys.executable, "-I", "-S", "-c", PROGRAM, str(source), str(began), program]


def variables(environment: Mapping[str, str]) -> int:
    """The descriptor of a file with an environment, which the caller closes."""
    descriptor = os.memfd_create("environment", os.MFD_CLOEXEC)
    try:
        with os.fdopen(os.dup(descriptor), "wb") as file:
            file.writelines(os.fsencode(f"{name}={value}\0") for name, value in environment.items())
        os.lseek(descriptor, 0, os.SEEK_SET)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor
