"""A fork server that was started early ends with its command."""

import argparse
import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from dodo_dsl.cli.loading import begin, loading
from dodo_dsl.run.process import fork_server
from dodo_dsl.run.process.fork_server import ForkServer
from tests.run.desk import ROOT


def options(**chosen: str) -> argparse.Namespace:
    return argparse.Namespace(**{"backend": None, "isolation": None} | chosen)


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[ForkServer]]:
    """The fork servers that a test starts."""
    servers: list[ForkServer] = []
    start = ForkServer.__init__

    def remembered(self: ForkServer) -> None:
        start(self)
        servers.append(self)

    monkeypatch.setattr(fork_server.ForkServer, "__init__", remembered)
    yield servers
    for server in servers:
        server.close()


def test_one_that_has_begun_is_taken_and_ends(started: list[ForkServer]) -> None:
    begin(["sil-closed-straight"])
    with loading(options()) as server:
        assert started == [server]
    assert started[0]._process.poll() is not None


@pytest.mark.parametrize("words", [["--help"], ["--backend", "docker"], ["--isolation=host"]])
def test_none_begins_in_vain(words: list[str], started: list[ForkServer]) -> None:
    begin(["sil-closed-straight", *words])
    assert started == []


@pytest.mark.thorough
def test_one_that_has_begun_ends_with_a_command_that_is_refused(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "dodo_dsl", "run", "--no-such-option"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MARK": str(tmp_path)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, check=False, timeout=60)
    assert (done.returncode, done.stdout) == (2, b"")
    deadline = time.monotonic() + 60
    while left := marked(f"MARK={tmp_path}"):
        assert time.monotonic() < deadline, left
        time.sleep(0.05)


def marked(variable: str) -> list[str]:
    """Processes with a variable."""
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            if variable.encode() in path.read_bytes().split(b"\0"):
                found.append(path.parent.name)
    return found


def test_it_begins_before_anything_large_is_loaded() -> None:
    """As it is to load beside the command."""
    program = "import sys, dodo_dsl.cli.loading; print(*sys.modules)"
    words = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    assert {"asyncio", "yaml", "jinja2", "numpy", "google.protobuf", "dodo_dsl.compiler"}.isdisjoint(words)
