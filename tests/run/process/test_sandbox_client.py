"""What the process backend does when its sandbox or its fork server does not answer."""

import asyncio
import os
import signal
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.run.process import sandbox_client
from dodo_dsl.run.process.fork_server_client import ForkServer
from dodo_dsl.run.process.host_isolation import isolation_refusal
from dodo_dsl.run.process.slot import Slot
from tests.run.helpers import Bench


@pytest.mark.slow
def test_a_sandbox_that_reads_nothing_is_waited_for_only_so_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sandbox_client, "SEND_S", 1)
    lost: list[str] = []

    async def scene() -> None:
        client = sandbox_client.SandboxClient(lambda _: None, lost.append)
        with tempfile.TemporaryFile() as log:
            await client.open(Slot(0), log.fileno())
            assert client.pid
            os.kill(client.pid, signal.SIGSTOP)
            while not lost:
                client.send({"do": "listeners", "padding": "x" * 10_000})
            os.kill(client.pid, signal.SIGKILL)
            await client.close()

    asyncio.run(scene())
    assert lost[0] == "the test's sandbox cannot be reached: it has read nothing for 1 s"


@pytest.mark.slow
def test_words_and_variables_may_be_longer_than_a_message(tmp_path: Path) -> None:
    bench = Bench(tmp_path, "host")
    plan = bench.plan()
    (app,) = plan.application.services
    large = replace(app, environment={f"LARGE_{n}": "x" * 10_000 for n in range(30)})
    (outcome,) = bench.run(replace(plan, application=replace(plan.application, services=(large,))))
    assert (outcome.outcome, outcome.reason) == ("passed", "it drove")


@pytest.mark.slow
def test_a_fork_server_that_has_ended_is_not_the_kernels_fault(tmp_path: Path) -> None:
    server = ForkServer()
    server.kill()
    refusal = asyncio.run(isolation_refusal(server))
    assert refusal is not None and not refusal.remedy
    assert refusal.why == "the test's sandbox does not start: it ended at once, with the process that starts it"
