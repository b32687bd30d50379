import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.report.viewer.chromium import PROGRAM, Chromium


@pytest.fixture(scope="session")
def chromium() -> Iterator[Chromium]:
    """One browser for all pages; tests that use it run in one process."""
    if PROGRAM is None:
        pytest.skip("there is no chromium: scripts/install-chromium")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Chromium(Path(profile))
        yield browser
        browser.close()
