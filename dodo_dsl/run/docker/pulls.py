"""Pulls images before a test begins: DoDo's own when they are missing, the application's always.

Where engine and registry have none, it says where images of DoDo's services and a user's own come from.
"""

import asyncio
import threading
from collections.abc import Callable, Coroutine, Iterable, Mapping
from types import MappingProxyType
from typing import Any

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.docker.client import engine_error
from dodo_dsl.run.process.commands import own_module
from dodo_dsl.run.protocol import BackendError, Say
from dodo_dsl.spec.deployment import build_command


class Pulls:
    """Pulls images for all tests of a run: each once, several at a time."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._tasks: dict[str, asyncio.Task[str | None]] = {}
        self._interrupted = threading.Event()
        self._hints: dict[str, str] = {}

    async def provide(
        self, own: Iterable[str], application: Iterable[str], say: Say, hints: Mapping[str, str] = MappingProxyType({})
    ) -> list[str]:
        """Makes the images local; returns notes on those that could not be updated.

        ``hints`` say of images how to do without a pull. Raises BackendError.
        """
        self._hints.update(hints)
        waits = [self._pull_once(image, self._own, say) for image in sorted(set(own))]
        waits += [self._pull_once(image, self._application, say) for image in sorted(set(application))]
        return [note for note in await asyncio.gather(*waits) if note]

    async def _pull_once(self, image: str, work: Callable[[str, Say], str], say: Say) -> str | None:
        return await self.once(image, lambda: self._in_thread(work, image, say))

    async def _in_thread(self, work: Callable[[str, Say], str], image: str, say: Say) -> str:
        """Pulls in a thread, which stops at its next step when the run is interrupted."""
        try:
            return await asyncio.to_thread(work, image, say)
        except asyncio.CancelledError:
            self._interrupted.set()
            raise

    async def once(self, key: str, work: Callable[[], Coroutine[Any, Any, str | None]]) -> str | None:
        """Does work once for all tests of the run; later callers wait for the first.

        Failed work is forgotten, so that a retried test repeats it.
        """
        task = self._tasks.get(key)
        if task is None:
            task = self._tasks[key] = asyncio.ensure_future(work())
            task.add_done_callback(lambda done: self._forget_failed(key, done))
        return await asyncio.shield(task)

    def _forget_failed(self, key: str, task: "asyncio.Task[str | None]") -> None:
        if task.cancelled() or task.exception() is not None:
            del self._tasks[key]

    def _own(self, image: str, say: Say) -> str:
        return "" if self._has(image) else self._application(image, say)

    def _application(self, image: str, say: Say) -> str:
        try:
            self._pull(image, say)
        except BackendError as error:
            if self._has(image):
                return f"{error}; the local image is used"
            if image in self._hints:
                raise BackendError(f"{error}; {self._hints[image]}") from error
            raise
        return ""

    def _has(self, image: str) -> bool:
        from docker.errors import DockerException, ImageNotFound

        try:
            self._client.api.inspect_image(image)
        except ImageNotFound:
            return False
        except (DockerException, OSError) as error:
            raise BackendError(f"the Docker engine cannot inspect image {image}: {error}") from error
        return True

    def _pull(self, image: str, say: Say) -> None:
        from docker.errors import DockerException

        say(f"pulling {image}")
        is_told = False
        try:
            for line in self._client.api.pull(image, stream=True, decode=True):
                if self._interrupted.is_set():
                    return
                if "error" in line:
                    raise _problem(image, str(line["error"]))
                if not is_told and str(line.get("status")).startswith("Retrying"):
                    is_told = True
                    say(f"pulling {image}: the connection broke, the engine retries")
        except (DockerException, OSError) as error:
            raise _problem(image, engine_error(error)) from error


def _problem(image: str, text: str) -> BackendError:
    """The engine's text, with how to log in; Docker's own registry says that itself, also of what it does not have."""
    host = image.partition("/")[0]
    is_named = "/" in image and ("." in host or ":" in host or host == "localhost")
    if is_named and any(word in text for word in ("unauthorized", "denied", "no basic auth")):
        text = f"{text}; if the registry requires a login: docker login {host}"
    return BackendError(f"image {image} cannot be pulled: {text}")


def image_hints(plan: Plan) -> dict[str, str]:
    """How to get each image that has the prefix and the tag of DoDo's, by its reference."""
    prefix, _, last = plan.sandbox_image.rpartition("/")
    tag = last.rpartition(":")[2]
    all_of_them = f"'{build_command(prefix, tag)}' makes it"
    found = {plan.sandbox_image: all_of_them}
    for service in plan.services:
        place, _, image = service.image.rpartition("/")
        name, _, version = image.rpartition(":")
        if (place, version) != (prefix, tag):
            continue
        if own_module(service.process):
            found[service.image] = all_of_them
        else:
            command = build_command(prefix, tag, name)
            found[service.image] = f"build it from your own Dockerfile on {prefix}/base:{tag}: {command}"
    return found
