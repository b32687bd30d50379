"""Work that tests of a run share: once while it succeeds, again when it failed."""

import asyncio
from collections.abc import Callable, Coroutine

import pytest

from dodo_dsl.run.docker.pulls import Pulls, building
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


def test_images_that_were_never_built() -> None:
    made = plan(sandbox_image="team/sandbox:7")
    told = "; 'dodo images build --prefix team --tag 7' makes DoDo's images, and your own ones build on team/base:7"
    assert [building(made, name) for name in ("team/judge:7", "team/judge:8", "other/judge:7")] == [told, "", ""]
