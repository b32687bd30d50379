"""Exit codes of every command (design section 4); a higher one outranks a lower one."""

from enum import IntEnum


class Exit(IntEnum):
    OK = 0
    PROBLEMS = 1
    USAGE = 2
    ERROR = 3
    INTERRUPTED = 130
