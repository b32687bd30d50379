"""How long others waited while a test ran."""

from pathlib import Path

import pytest

from tests import pressure
from tests.pressure import Pressure


@pytest.mark.parametrize(("waited_s", "share"), [(0.1, 0.05), (1.0, 0.5)])
def test_the_share_of_a_try(waited_s: float, share: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kernel, now = tmp_path / "cpu", 100.0
    kernel.write_text("some avg10=0.00 avg60=0.00 avg300=0.00 total=7000000\nfull avg10=0.00 total=0\n")
    monkeypatch.setattr(pressure, "_KERNEL", kernel)
    monkeypatch.setattr(pressure.time, "monotonic", lambda: now)
    found = Pressure()
    now += 2.0
    kernel.write_text(f"some avg10=9.00 avg60=9.00 avg300=9.00 total={7000000 + round(waited_s * 1e6)}\n")
    assert found.share == pytest.approx(share)


def test_a_kernel_that_does_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pressure, "_KERNEL", tmp_path / "none")
    assert Pressure().share is None
