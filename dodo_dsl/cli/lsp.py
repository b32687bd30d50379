"""dodo lsp: check tests in an editor whenever one is saved."""

import argparse
import contextlib
import os
import sys
from typing import TextIO

from dodo_dsl.cli.errors import Exit, UsageError

EXAMPLES = """examples:
  dodo lsp                  started by an editor; it speaks the language server protocol on standard input and output

docs/how-to/running.md has the settings for VS Code, Neovim and PyCharm.
"""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--stdio", action="store_true", help="accepted for editors that add it, and without effect")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    from dodo_dsl.lsp.server import serve

    if sys.stdin is None or sys.stdin.isatty():
        raise UsageError("an editor starts this program and speaks with it; docs/how-to/running.md says how")
    with (
        contextlib.redirect_stdout(sys.stderr),  # what is printed by mistake is not a message
        os.fdopen(os.dup(1), "wb") as messages,
        os.fdopen(os.dup(0), "rb") as requests,
    ):
        serve(requests, messages)
    return Exit.OK
