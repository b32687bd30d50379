"""What tests of searches share."""

from collections.abc import Iterator

import pytest

from tests.search.database import Database, served


@pytest.fixture(scope="session")
def database() -> Iterator[Database]:
    """One server for all tests of a process."""
    yield from served()
