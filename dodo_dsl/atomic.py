"""Files and folders that appear whole or not at all: written beside their place under a hidden name, then renamed.

A file replaces nothing but a file, and a folder nothing but an empty folder of this user: devices, FIFOs and sockets
stay. A symlink to a file is replaced; what it points to stays.
A file that is replaced keeps its permissions. With ``durable`` it outlives a loss of power, too.
"""

import contextlib
import errno
import io
import os
import shutil
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from dodo_dsl.opendlv.regular_file import kind_of

_MOST_NAME = 40
"""Characters of the target's name in a temporary one, which with the rest stays below the 255 bytes of a name."""


class NotReplaceable(OSError):
    """What is in the place of an output is not replaced, whatever the user says; names it."""

    usage = True


def refuse_others(path: Path) -> None:
    """Raises NotReplaceable where a file cannot become ``path``, IsADirectoryError for a folder, and OSError.

    To be called before the work whose result goes there.
    """
    with contextlib.suppress(FileNotFoundError):
        mode = path.stat().st_mode  # of what a symlink points to
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(mode):
            raise NotReplaceable(errno.EINVAL, f"{kind_of(mode)}, which no output replaces", str(path))


@contextmanager
def replacing(path: Path, durable: bool = False) -> Iterator[Path]:
    """The name of a file for the block to make, which takes the place of ``path`` when it ends well.

    The folder is made if there is none. Raises OSError that names ``path``, also for what fails in the block with
    the temporary file.
    """
    refuse_others(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = _beside(path)
    with _naming(path, part):
        try:
            yield part
            _keep_permissions(path, part)
            if durable:
                _flush(part)
            refuse_others(path)
            part.replace(path)
        except BaseException:
            part.unlink(missing_ok=True)
            raise
        if durable:
            _flush(path.parent)


def write_bytes(path: Path, content: bytes, durable: bool = False) -> None:
    """Replaces the file by one with this content; raises OSError."""
    with replacing(path, durable) as part, part.open("xb") as file:
        file.write(content)


def write_text(path: Path, text: str, durable: bool = False) -> None:
    """Replaces the file by one with this text in UTF-8; raises OSError."""
    write_bytes(path, text.encode(), durable)


def appended(path: Path) -> io.FileIO:
    """The file, opened to append without a buffer, new if there is none; its folder is made.

    Raises OSError, also where the name is a symlink, a device or a FIFO: others may write into folders of reports.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
    descriptor = os.open(path, flags, 0o666)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise NotReplaceable(errno.EINVAL, "not a file, and takes no output", str(path))
    os.set_blocking(descriptor, True)
    return io.FileIO(descriptor, "ab")


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """An empty folder to fill, which becomes ``path`` when the block ends well.

    Raises FileExistsError if ``path`` is there by then and not an empty folder of this user, and OSError.
    """
    with _stage(path) as stage:
        yield stage
        try:
            if path.is_symlink() or (path.exists() and path.stat().st_uid != os.geteuid()):
                raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
            stage.rename(path)
        except OSError as error:
            if error.errno in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR):
                raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path)) from None
            raise


@contextmanager
def files_into(target: Path) -> Iterator[Path]:
    """An empty folder to fill, whose files go to the folder ``target`` one by one when the block ends well.

    What ``target`` holds besides them stays. Raises OSError.
    """
    with _stage(target) as stage:
        yield stage
        for source in sorted(path for path in stage.rglob("*") if path.is_file()):
            place = target / source.relative_to(stage)
            refuse_others(place)
            place.parent.mkdir(parents=True, exist_ok=True)
            with _naming(place, source):
                source.replace(place)


@contextmanager
def _stage(path: Path) -> Iterator[Path]:
    path.parent.mkdir(parents=True, exist_ok=True)
    stage = _beside(path)
    with _naming(path, stage):
        try:
            stage.mkdir()
            yield stage
        finally:
            shutil.rmtree(stage, ignore_errors=True)


def _beside(path: Path) -> Path:
    path = path if path.name else path.resolve()
    return path.with_name(f".{path.name[:_MOST_NAME]}.{os.urandom(8).hex()}{path.suffix[:_MOST_NAME]}")


def _keep_permissions(path: Path, part: Path) -> None:
    with contextlib.suppress(FileNotFoundError):
        mode = path.lstat().st_mode
        if stat.S_ISREG(mode):
            part.chmod(stat.S_IMODE(mode))


def _flush(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def _naming(path: Path, part: Path) -> Iterator[None]:
    """An error of the temporary file, or of a write that names no file, names the file that is meant."""
    try:
        yield
    except OSError as error:
        if error.errno is None or error.filename not in (None, str(part)):
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error


class OutputExists(Exception):
    """A result would replace an existing file; one sentence."""

    usage = True


def refuse_existing(paths: Iterable[Path], force: bool) -> None:
    """Raises OutputExists for the first path that is there, unless it is a file and ``force`` is given."""
    for path in paths:
        try:
            refuse_others(path)
        except (NotReplaceable, IsADirectoryError) as error:
            raise OutputExists(f"'{path}' cannot take the result: {error.strerror}") from None
        if not force and path.exists():
            raise OutputExists(f"'{path}' exists already; --force replaces it")
