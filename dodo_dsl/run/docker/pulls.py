"""Pulls images before a test begins: DoDo's own when they are missing, the application's always.

Where engine and registry have none, it says where images of DoDo's services and a user's own come from.
"""

import asyncio
import threading
from collections.abc import Callable, Coroutine, Iterable, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.docker.client import engine_error
from dodo_dsl.run.process.commands import own_module
from dodo_dsl.run.protocol import BackendError, Say
from dodo_dsl.spec.deployment import build_command

_UNKNOWN = "unknown"
"""Of an image that does not say what it is for."""
_SMALLER = {"amd64": "386", "arm64": "arm"}
"""Whose programs most machines run, too."""


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
        """Makes the images local; returns notes on those that could not be updated, or are for another kind of machine.

        ``hints`` say of images how to do without a pull. Raises BackendError.
        """
        self._hints.update(hints)
        ours, theirs = sorted(set(own)), sorted(set(application))
        waits = [self._pull_once(image, self._own, say) for image in ours]
        waits += [self._pull_once(image, self._application, say) for image in theirs]
        notes = [note for note in await asyncio.gather(*waits) if note]
        return notes + await asyncio.to_thread(self._foreign, [*ours, *theirs])

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
        return "" if self._architecture(image) else self._application(image, say)

    def _application(self, image: str, say: Say) -> str:
        try:
            self._pull(image, say)
        except BackendError as error:
            if self._architecture(image):
                return f"{error}; the local image is used"
            if image in self._hints:
                raise BackendError(f"{error}; {self._hints[image]}") from error
            raise
        return ""

    def _foreign(self, images: Iterable[str]) -> list[str]:
        """A sentence on the images for each other kind of machine than the engine's."""
        here = self._machine
        kinds: dict[str, list[str]] = {}
        for image in images:
            kinds.setdefault(self._architecture(image), []).append(image)
        usual = ("", here, _UNKNOWN, _SMALLER.get(here))
        return [
            f"images for {kind}, which this engine's machine ({here}) can only emulate: {', '.join(found)}"
            for kind, found in kinds.items()
            if here and kind not in usual
        ]

    @cached_property
    def _machine(self) -> str:
        """What the engine's machine runs, such as ``amd64``; empty if it does not say."""
        from docker.errors import DockerException

        try:
            return str(self._client.api.version().get("Arch", ""))
        except (DockerException, OSError) as error:
            raise BackendError(f"the Docker engine does not say its version: {error}") from error

    def _architecture(self, image: str) -> str:
        """What a local image is for, such as ``arm64``; empty if there is no such image."""
        from docker.errors import DockerException, ImageNotFound

        try:
            found = self._client.api.inspect_image(image)
        except ImageNotFound:
            return ""
        except (DockerException, OSError) as error:
            raise BackendError(f"the Docker engine cannot inspect image {image}: {error}") from error
        return str(found.get("Architecture") or _UNKNOWN)

    def _pull(self, image: str, say: Say) -> None:
        from docker.errors import DockerException

        progress = _Progress(image, say)
        try:
            for line in self._client.api.pull(image, stream=True, decode=True):
                if self._interrupted.is_set():
                    return
                progress.take(line)
        except (DockerException, OSError) as error:
            raise _problem(image, engine_error(error)) from error


def _problem(image: str, text: str) -> BackendError:
    """The engine's text, with how to log in; Docker's own registry says that itself, also of what it does not have."""
    host = image.partition("/")[0]
    is_named = "/" in image and ("." in host or ":" in host or host == "localhost")
    if is_named and any(word in text for word in ("unauthorized", "denied", "no basic auth")):
        text = f"{text}; if the registry requires a login: docker login {host}"
    return BackendError(f"image {image} cannot be pulled: {text}")


class _Progress:
    """Reports the megabytes of an image's layers at each tenth, and once that the engine retries."""

    def __init__(self, image: str, say: Say) -> None:
        self._image = image
        self._say = say
        self._layers: dict[str, tuple[int, int]] = {}
        self._reported = -1
        self._retried = False

    def take(self, line: dict[str, Any]) -> None:
        if "error" in line:
            raise _problem(self._image, str(line["error"]))
        if str(line.get("status")).startswith("Retrying") and not self._retried:
            self._retried = True
            self._say(f"pulling {self._image}: the connection broke, the engine retries")
        detail = line.get("progressDetail") or {}
        if line.get("status") == "Downloading" and detail.get("total"):
            self._layers[line["id"]] = (detail["current"], detail["total"])
            self._report()

    def _report(self) -> None:
        done, total = (sum(part) for part in zip(*self._layers.values(), strict=True))
        tenth = 10 * done // max(total, 1)
        if tenth > self._reported:
            self._reported = tenth
            self._say(f"pulling {self._image}: {done / 1e6:.0f} of {total / 1e6:.0f} MB")


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
