"""Questions to the person at a rig."""

import sys
from collections.abc import Callable
from typing import TextIO

from dodo_dsl.cli.errors import UsageError
from dodo_dsl.terminal import printable


def asker(stderr: TextIO) -> Callable[[str], str]:
    """Asks a person with a prompt for a line; it raises UsageError at the end of standard input."""

    def ask(prompt: str) -> str:
        stderr.write(printable(prompt))
        stderr.flush()
        line = sys.stdin.readline()
        if not line:
            stderr.write("\n")
            raise UsageError("standard input ended; --readings FILE, --reading or --pictures FOLDER needs no answers")
        return line.strip()

    return ask
