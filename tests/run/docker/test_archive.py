"""Files out of a container: streamed, whole or not there, and only plain ones with plain names."""

import io
import tarfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from dodo_dsl.run.docker.cleanup import copy_out


def archive(*members: tuple[str, bytes | str]) -> bytes:
    """A tar of files, or of links where the content is a text."""
    target = io.BytesIO()
    with tarfile.open(fileobj=target, mode="w") as tar:
        for name, content in members:
            info = tarfile.TarInfo(name)
            if isinstance(content, str):
                info.type, info.linkname = tarfile.SYMTYPE, content
                tar.addfile(info)
            else:
                info.size = len(content)
                tar.addfile(info, io.BytesIO(content))
    return target.getvalue()


class Container:
    """What an engine sends of a container's folder, in pieces of a size."""

    def __init__(self, data: bytes, piece: int = 1000) -> None:
        self.pieces = [data[i : i + piece] for i in range(0, len(data), piece)]

    def get_archive(self, _folder: str, chunk_size: int) -> tuple[Iterator[bytes], dict[str, str]]:
        return iter(self.pieces), {}


@pytest.mark.parametrize("piece", [1, 511, 512, 100_000])
def test_files_come_whole_in_pieces_of_any_size(tmp_path: Path, piece: int) -> None:
    data = bytes(range(256)) * 41
    copy_out(Container(archive(("./test.rec", data), ("empty", b"")), piece), "/dodo/report/.", tmp_path)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == {"test.rec": data, "empty": b""}


def test_names_that_leave_the_folder_and_links_are_passed_over(tmp_path: Path) -> None:
    target = tmp_path / "report"
    hostile = archive(("../above", b"x"), ("/abs/olute", b"y"), ("..", b"z"), ("link", "/etc/passwd"), ("a/../b", b"b"))
    copy_out(Container(hostile), "/dodo/report/.", target)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["report"]
    assert {p.name: p.read_bytes() for p in target.iterdir()} == {"above": b"x", "olute": b"y", "b": b"b"}


@pytest.mark.parametrize("damage", [b"no archive at all" * 100, archive(("test.rec", bytes(5000)))[:3000]])
def test_damaged_streams_are_errors_of_the_system(tmp_path: Path, damage: bytes) -> None:
    with pytest.raises(OSError, match="the archive from the engine is damaged"):
        copy_out(Container(damage), "/dodo/report/.", tmp_path)
    assert list(tmp_path.iterdir()) == []
