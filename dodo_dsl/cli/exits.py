"""Exit codes of every command (design section 4); a higher one outranks a lower one."""

from collections.abc import Iterable
from enum import IntEnum


class Exit(IntEnum):
    OK = 0
    PROBLEMS = 1
    USAGE = 2
    ERROR = 3
    INTERRUPTED = 130


def of_outcomes(outcomes: Iterable[str]) -> Exit:
    """The exit code for tests that passed, failed or ended in error."""
    kinds = set(outcomes)
    return Exit.ERROR if "error" in kinds else Exit.PROBLEMS if "failed" in kinds else Exit.OK
