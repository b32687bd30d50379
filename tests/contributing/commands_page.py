"""The page of all commands, made of their help."""

import argparse
import os
from collections.abc import Iterator
from pathlib import Path

from dodo_dsl.cli.main import parser

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "commands.md"
WIDTH = "110"
HEAD = """# Commands

What `--help` of each command says; `scripts/make-commands` writes this page.
"""


def text() -> str:
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = WIDTH  # which argparse reads
    try:
        return HEAD + "".join(sections(parser(), 2))
    finally:
        os.environ.pop("COLUMNS")
        if before is not None:
            os.environ["COLUMNS"] = before


def sections(words: argparse.ArgumentParser, depth: int) -> Iterator[str]:
    """A section for each command, and one below it for each of its actions."""
    for action in words._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                yield f"\n{'#' * depth} {below.prog}\n\n```text\n{below.format_help().rstrip()}\n```\n"
                yield from sections(below, depth + 1)
