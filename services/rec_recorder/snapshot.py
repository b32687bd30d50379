"""One picture of a shared memory as a PNG; only recorders with a snapshot load this."""

import logging
from pathlib import Path

from dodo_dsl.opendlv import pixels
from services.base.pictures import png
from services.rec_recorder.source import PictureSource

_log = logging.getLogger(__name__)


class SnapshotWriter:
    """The first picture of ``source``, and then the first from a test's begin on, in the file ``path``.

    A picture that cannot be written is logged; the recording goes on.
    """

    def __init__(self, source: PictureSource, path: Path) -> None:
        self._source, self._path = source, path
        self._is_wanted = True
        self._is_ours = False

    def begin(self) -> None:
        """The test begins: the next picture replaces what was taken before it."""
        self._source.skip()
        self._is_wanted = True

    def update(self, now: int) -> None:
        """Take what is there at `now`, microseconds, if a picture is still wanted."""
        taken = self._source.take(now) if self._is_wanted else None
        if taken is None:
            return
        self._is_wanted = False
        try:
            self._write(taken[0])
        except (ValueError, OSError) as error:
            _log.warning("no snapshot was taken: %s", error)

    def close(self) -> None:
        """Detach from the memory."""
        self._source.close()

    def _write(self, data: bytes) -> None:
        layout = self._source.spec.layout(len(data))
        encoded = png(pixels.to_bgr(pixels.view(data, *layout), layout[0]))
        part = self._path.with_name(f".{self._path.name}.part")
        with part.open("xb") as file:
            file.write(encoded)
        try:
            if not self._is_ours:
                self._path.hardlink_to(part)  # what is there already is not this recorder's to replace
                self._is_ours = True
            part.replace(self._path)
        finally:
            part.unlink(missing_ok=True)
