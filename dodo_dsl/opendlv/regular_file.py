"""Input from files, and from nothing else: a FIFO would be waited for, a device may never end, or move something."""

import errno
import io
import os
import stat
from pathlib import Path

MOST_BYTES = 64 << 20
"""Of a file that is read at once."""
_KINDS = {
    stat.S_ISCHR: "a device",
    stat.S_ISBLK: "a device",
    stat.S_ISFIFO: "a FIFO",
    stat.S_ISSOCK: "a socket",
}


class NotAFile(OSError):
    """A path of the user that names no regular file; has its name."""

    usage = True


def opened(path: Path, flags: int = 0) -> io.FileIO:
    """A regular file to read, without a buffer; raises NotAFile, IsADirectoryError and OSError."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC | flags)
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISREG(mode):
        return io.FileIO(descriptor, "rb")
    os.close(descriptor)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    raise NotAFile(errno.EINVAL, f"{kind_of(mode)}, expected a file", str(path))


def kind_of(mode: int) -> str:
    """What a mode that is not a regular file's and no folder's stands for, such as ``a FIFO``."""
    return next((text for is_kind, text in _KINDS.items() if is_kind(mode)), "no file")


def content(path: Path, most: int = MOST_BYTES) -> bytes:
    """The bytes of a regular file; raises OSError as ``opened`` does, and if there are more than ``most``."""
    with opened(path) as file:
        data = file.read(most + 1)
        while 0 < len(data) <= most and (more := file.read(most + 1 - len(data))):
            data += more
    if len(data) > most:
        raise OSError(errno.EFBIG, f"larger than {most} bytes", str(path))
    return data


def text(path: Path, most: int = MOST_BYTES) -> str:
    return content(path, most).decode().removeprefix("\ufeff")
