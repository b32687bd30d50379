"""The documentation as a site: its pages are complete, and their links lead somewhere."""

import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

from tests.contributing import commands_page

ROOT = Path(__file__).parents[2]


@pytest.mark.skipif(
    sys.version_info[:2] != (3, 11), reason="the help of other versions of Python is laid out otherwise"
)
def test_the_page_of_commands_is_up_to_date() -> None:
    assert commands_page.PAGE.read_text() == commands_page.text(), "run scripts/make-commands"


class Addresses(HTMLParser):
    """What a page loads: links that only lead somewhere else are none of it."""

    def __init__(self) -> None:
        super().__init__()
        self.loaded: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        named = dict(attrs)
        if tag in ("script", "img", "iframe", "source") and named.get("src"):
            self.loaded.append(str(named["src"]))
        if tag == "link" and named.get("rel") in ("stylesheet", "icon", "preload"):
            self.loaded.append(str(named.get("href")))


def build(folder: Path, builder: str) -> None:
    """A page that no list names and a link that leads nowhere are warnings."""
    words = ["-m", "sphinx", "-q", "-W", "--keep-going", "-b", builder, "-d", str(folder / "kept"), "-c", "docs/site"]
    done = subprocess.run(
        [sys.executable, *words, ".", str(folder / "site")], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_site_has_no_warning(tmp_path: Path) -> None:
    """Its pages are read, and not written."""
    build(tmp_path, "dummy")


@pytest.mark.slow
@pytest.mark.proof
def test_the_site_loads_nothing_from_elsewhere(tmp_path: Path) -> None:
    build(tmp_path, "html")
    pages = list((tmp_path / "site").rglob("*.html"))
    assert len(pages) > 40
    for page in pages:
        addresses = Addresses()
        addresses.feed(page.read_text())
        assert addresses.loaded
        assert [address for address in addresses.loaded if "//" in address] == []
