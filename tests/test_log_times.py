"""Times of a log's parts, beside it."""

from pathlib import Path

import pytest

from dodo_dsl import log_times
from dodo_dsl.log_times import LogTimes, read


def test_what_was_written_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter([1_000_000, 3_000_000, 9_000_000])
    monkeypatch.setattr(log_times.time, "time_ns", lambda: next(now))
    monkeypatch.setattr(log_times, "_MOST", 2)
    times = LogTimes(tmp_path / "logs" / "application.app.log")
    for offset in (0, 10, 20):
        times.note(offset)
    times.write()
    assert read(tmp_path / "logs" / "application.app.log") == ([0, 10], [1000, 3000])


def test_parts_that_come_together_are_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter([1_000_000, 1_900_000, 2_000_000])
    monkeypatch.setattr(log_times.time, "time_ns", lambda: next(now))
    times = LogTimes(tmp_path / "a.b.log")
    for offset in (0, 10, 20):
        times.note(offset)
    times.write()
    assert read(tmp_path / "a.b.log") == ([0, 20], [1000, 2000])


@pytest.mark.parametrize("content", [b"", b"\xff", b"1\n", b"x y\n", b"1" * 9999 + b" 1\n"])
def test_what_is_no_such_file_has_no_times(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.times").write_bytes(content)
    assert read(tmp_path / "a.log") == ([], [])
    assert read(tmp_path / "gone.log") == ([], [])
