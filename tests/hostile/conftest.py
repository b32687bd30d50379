"""What the tests of files share."""

import os
import socket
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.rec.conftest import record

__all__ = ["record"]


@pytest.fixture
def strange(tmp_path: Path) -> Iterator[dict[str, Path]]:
    """Paths that are not regular files, by kind. Devices are copies, so that a failing test damages nothing."""
    places = {name: tmp_path / f"strange-{name}" for name in ("fifo", "socket", "folder", "link", "device")}
    os.mkfifo(places["fifo"])
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(places["socket"]))
    places["folder"].mkdir()
    try:
        os.mknod(places["device"], 0o666 | stat.S_IFCHR, os.makedev(1, 3))
    except PermissionError:
        places["device"].symlink_to("/dev/null")
    places["link"].symlink_to(places["fifo"])
    yield places
    listener.close()
