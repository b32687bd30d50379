"""What ``dodo doctor`` says of a machine on which even looking fails."""

from pathlib import Path

import pytest

from dodo_dsl.run import health


def test_what_cannot_be_looked_at_is_a_finding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a folder that is gone; what else there is to look at is looked at."""
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    found = {finding.name: finding for finding in health.examine()}
    assert (found["disk"].state, found["disk"].text[:22]) == ("problem", "cannot be looked at: [")
    assert {"multicast", "shared memory", "docker engine", "left behind"} <= set(found)
