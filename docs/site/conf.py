"""Sphinx's settings for the documentation as a site: ``make site`` builds it into build/site, without a network.

Pages are the Markdown files of the repository where they are, so that their links work in both. What ``--help`` of each
command says is a page of the site alone.
"""

import argparse
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

project = "DoDo"
author = "the DoDo developers"
extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
root_doc = "docs/index"
include_patterns = [
    "README.md",
    "CHANGELOG.md",
    "CODE_OF_CONDUCT.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "benchmarks/README.md",
    "docs/*.md",
    "docs/**/*.md",
    "examples/**/README.md",
    "firmware/README.md",
    "services/*/README.md",
]
exclude_patterns = ["build", ".venv"]
suppress_warnings = ["misc.highlighting_failure"]  # pages show YAML that is wrong
myst_heading_anchors = 4
html_theme = "furo"
html_title = "DoDo"
html_copy_source = False
html_show_sphinx = False
templates_path = ["."]
html_sidebars = {
    "**": [
        "sidebar/brand.html",
        "sidebar/search.html",
        "sidebar/scroll-start.html",
        "sidebar/navigation.html",
        "demo.html",
        "sidebar/scroll-end.html",
    ]
}


def setup(app: Any) -> None:
    """Writes the page of commands, before pages are looked for."""
    root = Path(__file__).resolve().parents[2]
    sys.path.insert(0, str(root))
    os.environ["COLUMNS"] = "110"  # which argparse reads
    from dodo_dsl import atomic
    from dodo_dsl.cli.main import parser

    atomic.write_text(root / "docs/reference/commands.md", "# Commands\n" + "".join(_sections(parser(), 2)))


def _sections(words: argparse.ArgumentParser, depth: int) -> Iterator[str]:
    """A section for each command, and one below it for each of its actions."""
    for action in words._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                yield f"\n{'#' * depth} {below.prog}\n\n```text\n{below.format_help().rstrip()}\n```\n"
                yield from _sections(below, depth + 1)
