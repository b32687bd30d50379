"""The output of a command replaces regular files only, whoever made what is in its place."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from dodo_dsl import atomic
from dodo_dsl.report.report_folder import forget
from tests.hostile.command import STRANGER, dodo
from tests.rec.conftest import dodo_rec, video

ROOT = Path(__file__).parents[2]


WRITTEN = {"cut": "new.rec", "--csv": "opendlv.proxy.ImageReading-0.csv", "--all": "annotations.json"}
"""The files that commands write, by their last word."""


@pytest.mark.parametrize("kind", ["fifo", "socket", "device", "link", "folder"])
@pytest.mark.parametrize("words", [("cut",), ("export", "--csv"), ("export", "--coco", "--all")], ids=" ".join)
def test_a_command_replaces_nothing_but_files(
    record: Callable[..., Path], strange: dict[str, Path], kind: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    target, output = tmp_path / "new" / WRITTEN[words[-1]], tmp_path / "new"
    output.mkdir()
    strange[kind].rename(target)
    before = target.lstat().st_ino
    code, _, stderr = dodo_rec(*words, record(video(1)), "-o", target if words == ("cut",) else output, "--force")
    assert (code, "cannot take the result" in stderr, target.lstat().st_ino) == (2, True, before), stderr
    assert [path.name for path in output.iterdir()] == [target.name]


@pytest.mark.parametrize(
    "place", ["/dev/dodo-new.rec", "/dev/shm/../dodo-new.rec", "/proc/self/comm", "/sys/dodo-new.rec"]
)
def test_the_kernel_s_folders_take_no_output(record: Callable[..., Path], place: str) -> None:
    before = Path(place).lstat() if os.path.lexists(place) else None
    code, _, stderr = dodo_rec("cut", record(video(1)), "-o", place, "--force")
    assert (code, f"/{place.split('/')[1]} belongs to the kernel, and takes no output" in stderr) == (2, True)
    after = Path(place).lstat() if os.path.lexists(place) else None
    assert (before and before.st_ino) == (after and after.st_ino)


def files_into(path: Path) -> None:
    with atomic.files_into(path.parent) as stage:
        (stage / path.name).write_text("new")


def new_folder(path: Path) -> None:
    with atomic.new_folder(path):
        pass


WRITERS: dict[str, Callable[[Path], object]] = {
    "write_text": lambda path: atomic.write_text(path, "new"),
    "write_bytes": lambda path: atomic.write_bytes(path, b"new", durable=True),
    "files_into": files_into,
    "appended": lambda path: atomic.appended(path).close(),
    "new_folder": new_folder,
}


@pytest.mark.parametrize("kind", ["fifo", "socket", "device", "link"])
@pytest.mark.parametrize("writer", WRITERS)
def test_no_writer_replaces_what_is_no_file(strange: dict[str, Path], kind: str, writer: str) -> None:
    """No output replaces a device, FIFO, socket or folder."""
    before = strange[kind].lstat().st_ino
    with pytest.raises(OSError, match=f"strange-{kind}"):
        WRITERS[writer](strange[kind])
    assert strange[kind].lstat().st_ino == before


@pytest.mark.thorough
@pytest.mark.parametrize("link", ["", "files", "files/maps"])
def test_compiling_follows_no_symlink(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, link: str) -> None:
    """Compiling follows no symlink that a repository has in the place of output."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dodo.yml").write_text(f"dodo: 1\napplication: {ROOT}/examples/kiwi/docker-compose.yml\n")
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "precious").write_text("untouched")
    place = tmp_path / "generated" / "sil-closed-straight" / link
    place.parent.mkdir(parents=True)
    place.symlink_to(tmp_path / "theirs")
    code, output = dodo("compile", "sil-closed-straight")
    assert (code, "a symlink, which no output follows" in output) == (2, True), output
    assert [path.name for path in (tmp_path / "theirs").iterdir()] == ["precious"]


@pytest.mark.parametrize("link", ["sil-a", "sil-a/logs", "sil-a/attempts"])
def test_an_earlier_report_is_removed_without_following_symlinks(tmp_path: Path, link: str) -> None:
    (tmp_path / "theirs" / "logs").mkdir(parents=True)
    (tmp_path / "theirs" / "logs" / "precious").write_text("untouched")
    place = tmp_path / "report" / link
    place.parent.mkdir(parents=True)
    place.symlink_to(tmp_path / "theirs")
    forget(tmp_path / "report", ["sil-a"])
    assert (tmp_path / "theirs" / "logs" / "precious").read_text() == "untouched"
    assert not place.exists()


@pytest.mark.parametrize("parameter", ["rec", "snapshot"])
@pytest.mark.parametrize(
    "name",
    ["/root/.ssh/authorized_keys", "../a.rec", "/etc/cron.d/a", "/tmp/../etc/a", "a/b", ".bashrc", "", "/dev/null"],
)
def test_a_spec_names_no_output_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, parameter: str, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dodo.yml").write_text("dodo: 1\nregistry: [.]\n")
    values = {"rec": "a.rec", "memories": ["a"], parameter: name}
    use = {"uses": "rec-recorder", "with": values}
    (tmp_path / "a.dodo.yml").write_text(f"dodo: 1\nname: a\nenvironment: {json.dumps({'more': use})}\n")
    _, output = dodo("compile", "--check")
    assert f"error[path-escape]: parameter '{parameter}' is '{name}', expected a file's name without" in output, output


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can make another user's folder")
def test_an_empty_folder_of_another_user_stays(tmp_path: Path) -> None:
    (tmp_path / "theirs").mkdir()
    os.chown(tmp_path / "theirs", STRANGER, STRANGER)
    with pytest.raises(FileExistsError):
        new_folder(tmp_path / "theirs")
    assert (tmp_path / "theirs").stat().st_uid == STRANGER
