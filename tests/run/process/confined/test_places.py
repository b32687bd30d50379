"""What a sandbox prepares for the application, in a mount namespace of a child of this process."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from dodo_dsl.run.process import namespaces
from dodo_dsl.run.process.confined.places import Places

USER = 64_250

pytestmark = pytest.mark.skipif(os.getuid() != 0, reason="who mounts without root is no root there either")


def refused(*_words: object, **_named: object) -> None:
    raise OSError(22, "refused")


def within(scene: Callable[[], object]) -> object:
    """What a scene gives in namespaces of its own, as JSON has it."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            namespaces.unshare()
            namespaces.furnish()
            told = scene()
        except OSError as error:
            told = [str(error.filename), error.strerror]
        os.write(writer, json.dumps(told).encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as answer:
        data = answer.read()
    os.waitpid(child, 0)
    return json.loads(data)


@pytest.fixture
def own(tmp_path: Path) -> Path:
    folder = tmp_path / "own, and: more"
    folder.mkdir(mode=0o700)
    (folder / "data").write_text("as it was")
    return folder


def test_writes_stay_apart_and_all_services_see_the_same(own: Path) -> None:
    def scene() -> object:
        places = Places(USER)
        (shown, writable), again = places.folder(str(own)), places.folder(str(own))
        owner = shown.stat().st_uid
        (shown / "data").write_text("changed")
        return [writable, again == (shown, writable), owner]

    assert within(scene) == [True, True, USER]
    assert (own / "data").read_text() == "as it was"


def test_where_no_overlay_can_be_mounted_it_is_read_only_for_each_service(
    own: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(namespaces, "overlay", refused)

    def scene() -> object:
        places = Places(USER)
        return [
            (path / "data").read_text() if not writable else "" for path, writable in map(places.folder, [str(own)] * 2)
        ]

    assert within(scene) == ["as it was"] * 2


def test_a_folder_that_its_user_could_not_read_is_an_error_and_not_the_applications_fault(
    own: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(namespaces, "bind_as", refused)
    said = "readable for its owner alone, and this kernel cannot show it to the application's user"
    assert within(lambda: bool(Places(USER).folder(str(own)))) == [str(own), said]
    own.chmod(0o755)
    assert within(lambda: bool(Places(USER).folder(str(own)))) is True
