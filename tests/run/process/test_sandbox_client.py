"""What the process backend does when its sandbox or its fork server does not answer."""

import signal
import socket
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.run import backends
from dodo_dsl.run.process import fork_server_client, sandbox_client
from tests.run.helpers import Bench


def test_a_sandbox_that_reads_nothing_is_waited_for_only_so_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sandbox_client, "CLOSE_S", 0.1)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setblocking(False)
    with ours, theirs, pytest.raises(OSError, match=r"it has read nothing for 0\.1 s"):
        for _ in range(1000):
            sandbox_client.send_with_patience(ours, bytes(10_000), ())


@pytest.mark.slow
def test_an_environment_that_is_too_large_is_the_services_fault(tmp_path: Path) -> None:
    bench = Bench(tmp_path, "host")
    plan = bench.plan()
    (app,) = plan.application.services
    large = replace(app, environment={f"LARGE_{n}": "x" * 10_000 for n in range(14)})
    (outcome,) = bench.run(replace(plan, application=replace(plan.application, services=(large,))))
    told = "service 'app' could not be started: 14"
    assert (outcome.outcome, outcome.reason[: len(told)]) == ("error", told)
    assert outcome.reason.endswith(" bytes of words and variables, expected at most 131,072")


@pytest.mark.slow
def test_without_a_fork_server_a_sandbox_of_its_own_is_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The fork server ends before the request, and during it."""
    real = fork_server_client.ForkServer

    class Gone(real):  # type: ignore[misc, valid-type]
        def __init__(self, descriptors: tuple[int, ...]) -> None:
            super().__init__(descriptors)
            self._process.kill()
            self._process.wait()

    class Going(real):  # type: ignore[misc, valid-type]
        def fork(self, *words: object) -> None:
            self._process.send_signal(signal.SIGSTOP)
            super().fork(*words)
            self._process.kill()

    for number, kind in enumerate((Gone, Going)):
        monkeypatch.setattr(backends, "ForkServer", kind)
        folder = tmp_path / str(number)
        folder.mkdir()
        bench = Bench(folder, "network")
        (outcome,) = bench.run(bench.plan())
        assert (outcome.outcome, outcome.reason) == ("passed", "it drove")
