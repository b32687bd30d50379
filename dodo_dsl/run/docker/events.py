"""The events of one compose project on an engine, watched in a thread."""

import asyncio
import contextlib
import threading
from collections.abc import Callable, Mapping
from typing import Any

from dodo_dsl.run.docker.cleanup import PROJECT_LABEL, SERVICE_LABEL


class EventWatch:
    """Calls ``on_event`` with a service's name, action and attributes, and ``on_lost`` with the reason at the end.

    Both are called in the event loop of the creator.
    """

    def __init__(self, on_event: Callable[[str, str, Mapping[str, str]], None], on_lost: Callable[[str], None]) -> None:
        self._on_event = on_event
        self._on_lost = on_lost
        self._loop = asyncio.get_running_loop()
        self._events: Any = None

    def begin(self, client: Any, project: str) -> None:
        """Starts the thread; raises DockerException and OSError."""
        self._events = client.events(decode=True, filters={"label": f"{PROJECT_LABEL}={project}"})
        threading.Thread(target=self._read, daemon=True).start()

    def call_in_loop(self, work: Callable[..., object], *arguments: Any) -> None:
        """Calls a function in the event loop, from any thread."""
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(work, *arguments)

    def _read(self) -> None:
        try:
            for event in self._events:
                self.call_in_loop(self._take, event)
        except Exception as error:  # noqa: BLE001  (whatever ended the stream, there are no more events)
            why = f"the Docker engine went away: {error}"
        else:
            why = "the Docker engine went away: its events ended"
        self.call_in_loop(self._on_lost, why)

    def _take(self, event: Mapping[str, Any]) -> None:
        attributes = event.get("Actor", {}).get("Attributes", {})
        name, action = attributes.get(SERVICE_LABEL, ""), str(event.get("Action", ""))
        if name:
            self._on_event(name, action, attributes)

    def close(self) -> None:
        if self._events is not None:
            with contextlib.suppress(Exception):
                self._events.close()
