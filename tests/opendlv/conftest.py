import json
import select
import subprocess
import sys
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

PATIENCE = 10.0


class Peer:
    """A process with libcluon in it; see cluon_peer.py for its orders."""

    def __init__(self, cid: int) -> None:
        script = Path(__file__).with_name("cluon_peer.py")
        self._process = subprocess.Popen(
            [sys.executable, str(script), str(cid)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
        )
        self._lines: list[bytes] = [b""]
        assert self.answer() == {"ready": True}

    def order(self, order: str, **arguments: Any) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps([order, arguments]).encode() + b"\n")

    def answer(self) -> Any:
        assert self._process.stdout is not None
        while len(self._lines) < 2:
            assert select.select([self._process.stdout], [], [], PATIENCE)[0], "libcluon is silent"
            data = self._process.stdout.read(65536)
            assert data, "libcluon has ended"
            first, *rest = data.split(b"\n")
            self._lines = [*self._lines[:-1], self._lines[-1] + first, *rest]
        return json.loads(self._lines.pop(0))

    def ask(self, order: str, **arguments: Any) -> Any:
        self.order(order, **arguments)
        return self.answer()

    def end(self) -> None:
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.close()
        try:
            self._process.wait(PATIENCE)
        finally:
            self._process.kill()
            self._process.wait()
            self._process.stdout.close()


@pytest.fixture
def peer(cid: int) -> Iterator[Peer]:
    """libcluon itself, in a session of number ``cid``."""
    pytest.importorskip("pycluon")
    process = Peer(cid)
    yield process
    process.end()


@pytest.fixture
def memory_name() -> Iterator[str]:
    """A name for shared memory that is used nowhere else; nothing of it may be left behind."""
    name = f"dodo-test-{uuid.uuid4().hex}.argb"
    yield name
    assert not Path("/tmp", name).exists()
    assert not Path("/dev/shm", name).exists()


@pytest.fixture(params=["sysv", "posix"])
def mode(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Each of libcluon's modes of shared memory, for this process and those that it starts afterwards."""
    monkeypatch.setenv("CLUON_SHAREDMEMORY_POSIX", "1" if request.param == "posix" else "0")
    return str(request.param)
