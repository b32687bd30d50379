"""Files out of a container, as the stream that the engine sends: never more of it in memory than a piece."""

import errno
import functools
import io
import shutil
import tarfile
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Any

from dodo_dsl.emit.output_folder import replace_file

MOST_BYTES = 4 << 30


def copy_out(container: Any, folder: str, target: Path, most: int = MOST_BYTES) -> None:
    """The plain files of a container's folder; names that would leave ``target`` and links are passed over.

    Each file is whole or not there. Raises OSError where the disk, the stream or ``most`` bytes of it end.
    """
    chunks, _ = container.get_archive(folder)
    try:
        with tarfile.open(fileobj=_Stream(chunks, most), mode="r|") as tar:
            for member in tar:
                name = Path(member.name).name
                if member.isfile() and name not in ("", ".", "..") and (content := tar.extractfile(member)):
                    replace_file(target / name, functools.partial(_fill, content))
    except tarfile.TarError as error:
        raise OSError(errno.EIO, f"what the engine sends of it is damaged ({error})") from error


def _fill(content: IO[bytes], path: Path) -> None:
    with path.open("wb") as file:
        shutil.copyfileobj(content, file)


class _Stream(io.RawIOBase):
    """Chunks of bytes as a file that can be read once; OSError when they are more than ``most`` bytes."""

    def __init__(self, chunks: Iterable[bytes], most: int) -> None:
        self._chunks = iter(chunks)
        self._most = most
        self._taken = 0
        self._rest = memoryview(b"")

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        if not self._rest:
            self._rest = memoryview(next((chunk for chunk in self._chunks if chunk), b""))
            self._taken += len(self._rest)
        if self._taken > self._most:
            raise OSError(errno.EFBIG, f"they are more than {self._most:,} bytes")
        count = min(len(buffer), len(self._rest))
        buffer[:count], self._rest = self._rest[:count], self._rest[count:]
        return count
