"""The documentation as a site: its pages are complete, and their links lead somewhere."""

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from tests.contributing import reference_pages

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("page", reference_pages.PAGES, ids=lambda page: page.stem)
def test_the_reference_of_files_and_variables_is_up_to_date(page: Path) -> None:
    assert page.read_text() == reference_pages.PAGES[page](), "run scripts/make-reference"


def build(folder: Path, builder: str) -> None:
    """A page that no list names and a link that leads nowhere are warnings."""
    words = ["-m", "sphinx", "-q", "-W", "--keep-going", "-b", builder, "-d", str(folder / "kept"), "-c", "docs/site"]
    done = subprocess.run(
        [sys.executable, *words, ".", str(folder / "site")], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


SITE = runpy.run_path(str(ROOT / "docs/site/conf.py"))
PAGES = {path for pattern in SITE["include_patterns"] for path in ROOT.glob(pattern)}


def headings(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub and MyST name them."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    plain = [re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", line) for line in re.findall(r"^#+ (.+)$", text, re.MULTILINE)]
    return {re.sub(r"[^\w\- ]", "", line.lower()).replace(" ", "-") for line in plain}


def test_every_link_leads_to_a_file_and_a_heading() -> None:
    lost = []
    for page in PAGES:
        text = re.sub(r"^ *```.*?^ *```$|`[^`\n]*`", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
        for place, anchor in re.findall(r"\]\((?!\w+:)([^)#\s]*)#?([^)\s]*)\)", text):
            target = (page.parent / place).resolve() if place else page
            is_lost = not target.exists() or (anchor and target in PAGES and anchor not in headings(target))
            lost += [f"{page.relative_to(ROOT)}: {place}#{anchor}"] if is_lost else []
    assert lost == []


def test_every_page_stands_in_a_list() -> None:
    """Of pages: a reader of the site finds no others."""
    listed = {ROOT / "docs/index.md"}
    for page in PAGES:
        for block in re.findall(r"^```\{toctree\}\n(.*?)^```$", page.read_text(), re.DOTALL | re.MULTILINE):
            for line in block.splitlines():
                if line and not line.startswith(":"):
                    name = re.sub(r".*<(.+)>$", r"\1", line)
                    place = os.path.relpath(page.parent / f"{name}.md", ROOT)
                    listed |= set(ROOT.glob(place))
    assert {str(page.relative_to(ROOT)) for page in PAGES - listed} == set()


@pytest.mark.slow
@pytest.mark.proof
def test_the_site_has_no_warning(tmp_path: Path) -> None:
    """Its pages are read, and not written."""
    build(tmp_path, "dummy")
