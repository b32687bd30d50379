"""Work that tests of a run share: once while it succeeds, again when it failed."""

import asyncio
from collections.abc import Callable, Coroutine

import pytest
from docker.errors import ImageNotFound

from dodo_dsl.plan.model import PlannedService
from dodo_dsl.run.docker import pulls as docker_pulls
from dodo_dsl.run.docker.pulls import Pulls
from dodo_dsl.run.protocol import BackendError
from tests.run.scripted import plan


def failing(times: int) -> tuple[list[int], Callable[[], Coroutine[None, None, str]]]:
    """A piece of work that fails at first, and what it notes of each try."""
    tries: list[int] = []

    async def work() -> str:
        tries.append(len(tries))
        await asyncio.sleep(0)
        if len(tries) <= times:
            raise BackendError("the registry is away")
        return "pulled"

    return tries, work


def test_what_failed_is_tried_again_and_then_kept() -> None:
    tries, work = failing(1)

    async def scene() -> list[str]:
        pulls = Pulls(None)
        with pytest.raises(BackendError):
            await pulls.once("image", work)
        return [await pulls.once("image", work) for _ in range(2)]

    assert asyncio.run(scene()) == ["pulled", "pulled"]
    assert len(tries) == 2


class EmptyEngine:
    """A client of an engine that has no image, and whose registries have none."""

    def __init__(self) -> None:
        self.api = self

    def inspect_image(self, _image: str) -> None:
        raise ImageNotFound("there is none")

    def pull(self, *_words: str, **_options: bool) -> None:
        raise ImageNotFound("not found")


def test_images_that_were_never_built() -> None:
    services = (
        PlannedService("evaluation", "judge", "judge", "team/judge:7", ("python", "-m", "my_services.judge")),
        PlannedService("evaluation", "radar", "radar", "elsewhere/radar:1", ("radar",)),
        PlannedService("evaluation", "track", "collision", "team/collision:7", ("python", "-m", "services.collision")),
    )
    hints = docker_pulls.image_hints(plan(services=services, sandbox_image="team/sandbox:7"))
    own = "build it from your own Dockerfile on team/base:7: dodo images build judge --prefix team --tag 7"
    shipped = "'dodo images build --prefix team --tag 7' makes it"
    assert hints == {"team/judge:7": own, "team/collision:7": shipped, "team/sandbox:7": shipped}
    for name, told in hints.items():
        with pytest.raises(BackendError, match=rf"^image {name} cannot be pulled: not found; {told}$"):
            asyncio.run(Pulls(EmptyEngine()).provide([name], [], lambda _: None, hints))
