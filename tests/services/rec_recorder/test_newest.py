"""The recording of pictures that keeps the newest ones."""

from pathlib import Path

import pytest

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.recording import read_envelopes
from services.rec_recorder.model import NewestPictures


def picture(number: int, size: int = 100) -> Envelope:
    return Envelope(1055, bytes(size), 1, 1, number, 0)


def test_the_oldest_go_where_there_are_too_many(tmp_path: Path) -> None:
    path = tmp_path / "frames.rec"
    pictures = NewestPictures(path, 1500)
    for number in range(40):
        pictures.write(picture(number))
        times = [e.sample_time for e in read_envelopes(path)]  # at any time, as a recorder may be killed
        assert times == list(range(times[0], number + 1))
        assert path.stat().st_size <= 1500
        assert number < 10 or path.stat().st_size > 900
    pictures.close()
    assert [file.name for file in tmp_path.iterdir()] == ["frames.rec"]


def test_a_picture_that_fits_nowhere_ends_it(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "frames.rec"
    pictures = NewestPictures(path, 1500)
    for size in (100, 2000, 100):
        pictures.write(picture(1, size))
    pictures.close()
    assert (pictures.is_on, len(list(read_envelopes(path)))) == (False, 1)
    assert [r.getMessage() for r in caplog.records] == ["no more pictures are recorded: a picture has 2031 bytes"]


def test_a_link_in_its_place_is_not_read(tmp_path: Path) -> None:
    """Who may write to the folder would else get what the recorder can read."""
    path, other = tmp_path / "frames.rec", tmp_path / "other"
    other.write_bytes(b"secret" * 1000)
    pictures = NewestPictures(path, 300)
    pictures.write(picture(1))
    path.unlink()
    path.symlink_to(other)
    for number in range(2, 6):
        pictures.write(picture(number))
    pictures.close()
    assert not pictures.is_on
    assert sorted(file.name for file in tmp_path.iterdir()) == ["frames.rec", "other"]
    assert path.is_symlink()
