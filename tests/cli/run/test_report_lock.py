"""Two runs with one report."""

import io
from pathlib import Path

from dodo_dsl.cli.run import reserved


def said(folder: Path) -> str:
    """What a run says that begins now."""
    out = io.StringIO()
    with reserved(folder, out):
        pass
    return out.getvalue()


def test_the_second_says_so_and_nothing_stays(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    with reserved(tmp_path, io.StringIO()):
        assert said(tmp_path).startswith(f"note: another run also writes into '{tmp_path}': ")
        assert said(tmp_path / "other") == ""
    assert said(tmp_path) == ""
    assert [path.name for path in tmp_path.iterdir()] == ["other"]
