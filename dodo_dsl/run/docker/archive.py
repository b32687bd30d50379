"""Copies files out of a container, from the stream that the engine sends, with one chunk at a time in memory."""

import errno
import io
import shutil
import tarfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from dodo_dsl import atomic

MAX_BYTES = 4 << 30


def copy_out(container: Any, folder: str, target: Path, max_bytes: int = MAX_BYTES) -> None:
    """Copies the regular files of a container's folder by their last name; links are skipped.

    Each file is complete or absent. Raises OSError when the disk is full, or the stream is damaged or longer than
    ``max_bytes``.
    """
    chunks, _ = container.get_archive(folder)
    try:
        with tarfile.open(fileobj=_Stream(chunks, max_bytes), mode="r|") as tar:
            for member in tar:
                name = Path(member.name).name
                if member.isfile() and name not in ("", ".", "..") and (content := tar.extractfile(member)):
                    with atomic.replacing(target / name) as part, part.open("xb") as file:
                        shutil.copyfileobj(content, file)
        for _ in chunks:  # of padding: a stream that is read to its end gives its connection back
            pass
    except tarfile.TarError as error:
        raise OSError(errno.EIO, f"the archive from the engine is damaged ({error})") from error


class _Stream(io.RawIOBase):
    """Chunks of bytes as a file that can be read once; raises OSError beyond ``max_bytes`` bytes."""

    def __init__(self, chunks: Iterable[bytes], max_bytes: int) -> None:
        self._chunks = iter(chunks)
        self._max_bytes = max_bytes
        self._taken = 0
        self._rest = memoryview(b"")

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        if not self._rest:
            self._rest = memoryview(next((chunk for chunk in self._chunks if chunk), b""))
            self._taken += len(self._rest)
        if self._taken > self._max_bytes:
            raise OSError(errno.EFBIG, f"more than {self._max_bytes:,} bytes")
        count = min(len(buffer), len(self._rest))
        buffer[:count], self._rest = self._rest[:count], self._rest[count:]
        return count
