"""What the process backend does when its sandbox does not."""

import socket

import pytest

from dodo_dsl.run import process
from dodo_dsl.run.process import ProcessBackend


def test_a_sandbox_that_reads_nothing_is_not_waited_for_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "_CLOSE_S", 0.1)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setblocking(False)
    with ours, theirs, pytest.raises(OSError, match=r"it has read nothing for 0\.1 s"):
        for _ in range(1000):
            ProcessBackend._send_patiently(ours, bytes(10_000), ())
