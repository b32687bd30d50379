"""The images that compiled tests name by default, built from the base image that needs no registry."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.docker.compose import Crate, new_crate
from tests.images.conftest import base_image, built  # noqa: F401


@pytest.fixture(scope="session")
def images(built: dict[str, str]) -> None:  # noqa: F811
    """They are there."""


@pytest.fixture
def crate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Crate]:
    """Tests with a mark of their own; nothing of them is left at the end."""
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    made = new_crate(tmp_path)
    yield made
    assert made.left() == []
