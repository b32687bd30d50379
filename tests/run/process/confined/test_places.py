"""What a sandbox prepares for the application, in a mount namespace of a child of this process."""

import json
import os
import tempfile
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


def test_writes_stay_apart_and_all_services_see_the_same(own: Path) -> None:
    def scene() -> object:
        places = Places(USER)
        (shown, writable), again = places.folder(str(own)), places.folder(str(own))
        owner = shown.stat().st_uid
        (shown / "data").write_text("changed")
        return [writable, again == (shown, writable), owner]

    assert within(scene, own) == [True, True, USER]
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

    assert within(scene, own) == ["as it was"] * 2


def test_a_folder_that_its_user_could_not_read_is_an_error_and_not_the_applications_fault(
    own: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(namespaces, "bind_as", refused)
    said = "readable for its owner alone, and this kernel cannot show it to the application's user"
    assert within(lambda: bool(Places(USER).folder(str(own))), own) == [str(own), said]
    own.chmod(0o755)
    assert within(lambda: bool(Places(USER).folder(str(own))), own) is True


def test_neither_umask_nor_tmpdir_decide_about_its_folders(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    elsewhere = own.parent / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(elsewhere))

    def scene() -> object:
        os.umask(0o077)
        places = Places(USER)
        shown, _ = places.folder(str(own))
        return [oct(path.stat().st_mode & 0o777) for path in (shown.parent, shown, places.home)]

    assert within(scene, own) == ["0o755"] * 3
    assert list(elsewhere.iterdir()) == []


@pytest.mark.thorough
def test_what_it_may_read_is_shown_as_its_own_where_the_kernel_can(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def owners() -> object:
        places = Places(USER)
        return [places.read(str(path)).stat().st_uid for path in (own, own, own / "data", "/usr")]

    assert within(owners, own) == [USER, USER, USER, 0]
    monkeypatch.setattr(namespaces, "bind_as", refused)
    assert within(owners, own) == [own.stat().st_uid] * 3 + [0]
    assert within(lambda: str(Places(USER).read("/no/such/path"))) == "/no/such/path"


@pytest.mark.parametrize("place", namespaces.SHARED, ids=str)
@pytest.mark.thorough
def test_folders_of_shared_places_stay_where_they_are_needed_and_files_do_not(place: Path) -> None:
    with tempfile.TemporaryDirectory(dir=place) as name, tempfile.NamedTemporaryFile(dir=place) as file:
        Path(name, "test").touch()
        there = lambda: [Path(name, "test").exists(), Path(file.name).exists()]  # noqa: E731
        assert within(there, Path(name, "test"), Path(file.name)) == [True, False]
        assert within(lambda: Path(name).exists()) is False
        assert within(lambda: list(map(str, Places(USER).shared[str(place)].glob("*/test"))), Path(name)) == []
        mounted = within(lambda: Places(USER).mounted, Path(name))
        assert isinstance(mounted, list) and name in mounted
