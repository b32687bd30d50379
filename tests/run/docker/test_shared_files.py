"""Which of a test's files the engine does not see, by what it says of a container that never starts."""

from pathlib import Path
from typing import Any

from docker.errors import APIError
from docker.types import HostConfig

from dodo_dsl.run.docker.shared_files import unseen


class Engine:
    """Has files below some folders only, and says so in the words of Docker 20.10 to 29."""

    def __init__(self, *folders: Path, error: Exception | None = None) -> None:
        self.api, self.folders, self.error, self.containers = self, folders, error, list[str]()

    def create_host_config(self, **words: Any) -> HostConfig:
        return HostConfig("1.41", **words)

    def create_container(self, _image: str, _command: list[str], **words: Any) -> dict[str, str]:
        if self.error:
            raise self.error
        for mount in words["host_config"]["Mounts"]:
            if not any(Path(mount["Source"]).is_relative_to(folder) for folder in self.folders):
                said = 'invalid mount config for type "bind": bind source path does not exist: '
                raise APIError("400", explanation=said + mount["Source"])
        self.containers.append("c1")
        return {"Id": "c1"}

    def remove_container(self, name: str, force: bool) -> None:
        assert force
        self.containers.remove(name)


def test_the_first_path_that_is_missing(tmp_path: Path) -> None:
    engine = Engine(tmp_path)
    assert unseen(engine, [tmp_path / "a", tmp_path / "b"]) is None
    assert engine.containers == []
    assert unseen(engine, [tmp_path / "a", Path("/team/app"), Path("/team/app/maps")]) == Path("/team/app")
