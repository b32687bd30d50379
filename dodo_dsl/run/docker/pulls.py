"""What all tests of a run share: each image is pulled once, DoDo's own when it is missing, the application's always."""

import asyncio
import os
from collections.abc import Callable, Coroutine, Iterable
from functools import partial
from pathlib import Path
from typing import Any

from docker.errors import DockerException, ImageNotFound

from dodo_dsl.application import secret_variables
from dodo_dsl.plan.model import Plan
from dodo_dsl.run.docker.client import run
from dodo_dsl.run.protocol import BackendError, Say
from dodo_dsl.spec.deployment import build_command


class Pulls:
    """Work that is done once for all tests of a run, and the images of the ``client``'s engine."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._tasks: dict[str, asyncio.Task[str | None]] = {}

    async def provide(self, plan: Plan, own: Iterable[str], application: Iterable[str], say: Say) -> list[str]:
        """Makes a test's images local; returns notes on those that could not be updated. Raises BackendError."""
        images = dict.fromkeys(application, False) | dict.fromkeys(own, True)
        waits = (self.once(name, partial(self._pull, name, images[name], plan, say)) for name in sorted(images))
        return [note for note in await asyncio.gather(*waits) if note]

    async def once(self, key: str, work: Callable[[], Coroutine[Any, Any, str | None]]) -> str | None:
        """Does work once for all tests of the run, but again after it failed; later callers wait for the first."""
        task = self._tasks.get(key)
        if task is None:
            task = self._tasks[key] = asyncio.ensure_future(work())
            task.add_done_callback(lambda done: self._forget_failed(key, done))
        return await asyncio.shield(task)

    def _forget_failed(self, key: str, task: "asyncio.Task[str | None]") -> None:
        if task.cancelled() or task.exception() is not None:
            del self._tasks[key]

    async def _pull(self, image: str, is_own: bool, plan: Plan, say: Say) -> str:
        if is_own and await asyncio.to_thread(self._has, image):
            return ""
        say(f"pulling {image}")
        code, text = await run(["pull", "--quiet", image], Path("/"), secret_variables.of_client(os.environ))
        if not code:
            return ""
        problem = f"image {image} cannot be pulled: {text.removeprefix('Error response from daemon: ')}"
        if await asyncio.to_thread(self._has, image):
            return f"{problem}; the local image is used"
        raise BackendError(f"{problem}{building(plan, image)}")

    def _has(self, image: str) -> bool:
        try:
            self._client.api.inspect_image(image)
        except ImageNotFound:
            return False
        except (DockerException, OSError) as error:
            raise BackendError(f"the Docker engine cannot inspect image {image}: {error}") from error
        return True


def building(plan: Plan, image: str) -> str:
    """How to get an image that has the prefix and the tag of DoDo's; empty for others."""
    prefix, _, last = plan.sandbox_image.rpartition("/")
    tag = last.rpartition(":")[2]
    if not image.startswith(f"{prefix}/") or not image.endswith(f":{tag}"):
        return ""
    return f"; '{build_command(prefix, tag)}' makes DoDo's images, and your own ones build on {prefix}/base:{tag}"
