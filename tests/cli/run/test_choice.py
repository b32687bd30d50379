"""The backend of a run that names none."""

from dataclasses import replace
from typing import Any

import pytest
from docker.errors import DockerException, ImageNotFound

from dodo_dsl.cli import run
from dodo_dsl.plan.model import Application, ApplicationService, PlannedService
from dodo_dsl.run.protocol import BackendError
from tests.run.scripted import plan

IMAGE = Application(".", (ApplicationService("app"),))
OWN = (PlannedService("environment", "camera", "camera", "dodo/camera:1", ("python",)),)


class Engine:
    """An engine's client that has one image, or none."""

    def __init__(self, *images: str, url: str = "http+docker://localhost", problem: Exception | None = None) -> None:
        self.images, self.api, self.base_url, self.problem = images, self, url, problem

    def inspect_image(self, image: str) -> None:
        if self.problem:
            raise self.problem
        if image not in self.images:
            raise ImageNotFound(image)


@pytest.mark.parametrize(
    ("engine", "root", "backend"),
    [
        (Engine("dodo/camera:1"), True, "docker"),
        (Engine(), True, "mixed"),
        (Engine(), False, "docker"),
        (Engine(url="https://elsewhere:2376"), True, "docker"),
        (Engine(problem=DockerException("gone")), True, "docker"),
        (None, True, "docker"),
    ],
)
def test_without_images_of_dodo(
    engine: Engine | None, root: bool, backend: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def connect() -> Any:
        if engine is None:
            raise BackendError("no engine")
        return engine

    monkeypatch.setattr("dodo_dsl.run.docker.client.connect", connect)
    monkeypatch.setattr(run, "may_enter", lambda: root)
    assert run.choose_backend([plan(application=IMAGE, services=OWN)]) == backend


def test_on_rigs_unless_the_application_can_be_started() -> None:
    assert run.choose_backend([plan(application=IMAGE, rig="desk")]) == "mixed"
    started = Application(".", (ApplicationService("app", ("python", "a.py")),))
    assert run.choose_backend([replace(plan(application=started), rig="desk")]) == "process"
