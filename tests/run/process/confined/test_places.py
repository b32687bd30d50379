"""What a sandbox prepares for the application, in a mount namespace of a child of this process."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from dodo_dsl.run.process import namespaces
from dodo_dsl.run.process.places import Places
from dodo_dsl.run.process.slot import Entered

USER = 64_250

pytestmark = pytest.mark.skipif(os.getuid() != 0, reason="who mounts without root is no root there either")


def refused(*_words: object, **_named: object) -> None:
    raise OSError(22, "refused")


def within(scene: Callable[[], object], *needed: Path) -> object:
    """What a scene gives in namespaces of its own, where it finds what is ``needed``, as JSON has it."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            namespaces.unshare()
            if (first := os.fork()) != 0:  # without a process 1, which lives, there are no others
                os.waitpid(first, 0)
                os._exit(0)
            namespaces.furnish(Entered.with_own(0, *needed).shown, {})
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


def test_writes_stay_apart(own: Path) -> None:
    def scene() -> object:
        places = Places(str(own), USER)
        owner = places.folder.stat().st_uid
        (places.folder / "data").write_text("changed")
        return [places.writable, owner]

    assert within(scene, own) == [True, USER]
    assert (own / "data").read_text() == "as it was"


@pytest.mark.thorough
def test_what_it_may_read_is_shown_as_its_own_where_the_kernel_can(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def owners() -> object:
        places = Places("/usr", USER)
        return [places.read(str(path)).stat().st_uid for path in (own, own, own / "data", "/usr")]

    assert within(owners, own) == [USER, USER, USER, 0]
    monkeypatch.setattr(namespaces, "bind_as", refused)
    assert within(owners, own) == [own.stat().st_uid] * 3 + [0]
    assert within(lambda: str(Places("/usr", USER).read("/no/such/path"))) == "/no/such/path"
