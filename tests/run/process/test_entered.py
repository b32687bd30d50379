"""What a sandbox enters, as a word of its command line."""

import sys
from pathlib import Path

from dodo_dsl.run.process.entered import Entered


def test_it_is_read_as_it_was_written(tmp_path: Path) -> None:
    entered = Entered.with_own(12, tmp_path / "a b")
    assert Entered.among(["3", "network", "--forks", entered.word()]) == entered
    assert entered.process == 12
    assert entered.shown[0] == tmp_path / "a b"
    assert Path(sys.prefix).resolve() in entered.shown
    assert Entered.among(["3", "network", "--forks"]) is None
