"""The containers of a test on the mixed backend: the application's, and one that holds what they share with DoDo."""

import asyncio
from typing import Any

from dodo_dsl.application.model import SANDBOX
from dodo_dsl.run.docker.backend import DockerBackend
from dodo_dsl.run.docker.client import engine_error
from dodo_dsl.run.docker.processes import ELSEWHERE, is_of
from dodo_dsl.run.mixed.compose import ApplicationCompose
from dodo_dsl.run.protocol import BackendError, Event


class ApplicationContainers(DockerBackend):
    """The docker backend without DoDo's services; ``process`` is that of the holder, 0 on the host's network."""

    compose_kind = ApplicationCompose
    process = 0

    @property
    def events(self) -> asyncio.Queue[Event]:
        """What has happened, for a backend beside this one to add to."""
        return self._events

    async def open(self) -> None:
        await super().open()
        if SANDBOX in self._containers:
            self.process = await asyncio.to_thread(self._find_process, self._containers[SANDBOX])

    @staticmethod
    def _find_process(container: Any) -> int:
        from docker.errors import DockerException

        try:
            container.reload()
        except (DockerException, OSError) as error:
            raise BackendError(f"the Docker engine cannot start the test: {engine_error(error)}") from error
        state = container.attrs["State"]
        process = int(state.get("Pid") or 0)
        if not process:
            why = state.get("Error") or f"exit code {state.get('ExitCode')}"
            raise BackendError(f"the container that holds the test's network ended at once: {why}")
        if not is_of(process, container.id):
            raise BackendError(f"{ELSEWHERE}, whose network DoDo's processes cannot enter; use --backend docker")
        return process
