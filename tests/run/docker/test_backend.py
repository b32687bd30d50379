"""What the backend makes of the ends of containers."""

import asyncio
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from dodo_dsl.run.docker.backend import DockerBackend
from dodo_dsl.run.protocol import Exited
from tests.run.scripted import plan

FATAL = "[FATAL tini (7)] exec drive failed: No such file or directory"


def test_words_of_a_program_are_no_excuse(tmp_path: Path) -> None:
    """With ``init: true`` the engine's first process says this of a program that cannot start; so can any program."""

    async def died() -> Any:
        client: Any = None
        backend = DockerBackend(plan("t"), tmp_path, tmp_path, client, client, "dodo-t", [], print, b"")
        done = asyncio.Event()
        done.set()
        output: Any = SimpleNamespace(done=done, tail=lambda: [FATAL])
        container = SimpleNamespace(attrs={"HostConfig": {"Init": True}})
        backend._outputs["driver"], backend._containers["driver"] = output, container
        await backend._died("driver", 127)
        return await backend.next_event()

    event = asyncio.run(died())
    assert isinstance(event, Exited)
    assert event.code == 127
