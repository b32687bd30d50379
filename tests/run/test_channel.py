"""What the process backend does when its sandbox does not."""

import socket
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.run import channel
from tests.run.helpers import Bench


def test_a_sandbox_that_reads_nothing_is_not_waited_for_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(channel, "CLOSE_S", 0.1)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setblocking(False)
    with ours, theirs, pytest.raises(OSError, match=r"it has read nothing for 0\.1 s"):
        for _ in range(1000):
            channel.send_patiently(ours, bytes(10_000), ())


def test_an_environment_that_is_too_large_is_the_services_fault(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    plan = bench.plan()
    (app,) = plan.application.services
    large = replace(app, environment={f"LARGE_{n}": "x" * 10_000 for n in range(14)})
    (outcome,) = bench.run(replace(plan, application=replace(plan.application, services=(large,))))
    told = "service 'app' could not be started: 14"
    assert (outcome.outcome, outcome.reason[: len(told)]) == ("error", told)
    assert outcome.reason.endswith(" bytes of words and variables, expected at most 131,072")
