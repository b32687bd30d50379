"""The events of one compose project on an engine, told in the loop of who watches it."""

import asyncio
import contextlib
import threading
from collections.abc import Callable, Mapping
from typing import Any

from dodo_dsl.run.docker.cleanup import PROJECT_LABEL, SERVICE_LABEL


class Watch:
    """``heard`` is told a service's name, what happened to it and its attributes; ``lost`` why nothing comes any more.

    Nobody is told anything once it ``ignores``, as teardown is.
    """

    def __init__(self, heard: Callable[[str, str, Mapping[str, str]], None], lost: Callable[[str], None]) -> None:
        self.ignores = False
        self._heard = heard
        self._lost = lost
        self._loop = asyncio.get_running_loop()
        self._events: Any = None

    def begin(self, client: Any, project: str) -> None:
        """From now on in a thread of its own; raises DockerException and OSError."""
        self._events = client.events(decode=True, filters={"label": f"{PROJECT_LABEL}={project}"})
        threading.Thread(target=self._read, daemon=True).start()

    def tell(self, work: Callable[..., object], *arguments: Any) -> None:
        """Calls something in the loop, from whatever thread."""
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(work, *arguments)

    def _read(self) -> None:
        try:
            for event in self._events:
                self.tell(self._take, event)
        except Exception as error:  # noqa: BLE001  (whatever ends the stream, the engine is out of sight)
            why = f"the Docker engine went away: {error}"
        else:
            why = "the Docker engine went away: its events ended"
        if not self.ignores:
            self.tell(self._lost, why)

    def _take(self, event: Mapping[str, Any]) -> None:
        attributes = event.get("Actor", {}).get("Attributes", {})
        name, action = attributes.get(SERVICE_LABEL, ""), str(event.get("Action", ""))
        if name and not self.ignores:
            self._heard(name, action, attributes)

    def close(self) -> None:
        self.ignores = True
        if self._events is not None:
            with contextlib.suppress(Exception):
                self._events.close()
