"""The end of a command: its exit code, and one sentence on an error, whichever part of DoDo raised it.

Exit codes are the same for every command (design section 4); a higher one outranks a lower one.
"""

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from enum import IntEnum


class Exit(IntEnum):
    OK = 0
    PROBLEMS = 1
    USAGE = 2
    ERROR = 3
    INTERRUPTED = 130


def of_outcomes(outcomes: Iterable[str]) -> Exit:
    kinds = set(outcomes)
    return Exit.ERROR if "error" in kinds else Exit.PROBLEMS if "failed" in kinds else Exit.OK


class UsageError(Exception):
    """A command line or a file that it names is wrong; one sentence, exit code 2."""

    usage = True


def require_extra(what: str, extra: str) -> None:
    """Raises UsageError with what to type where a module of an extra of DoDo's cannot be loaded."""
    from dodo_dsl import advice

    if module := advice.missing(extra):
        raise UsageError(f"{what} needs {module}: {advice.install(extra)}")


@contextmanager
def files_of_the_user() -> Iterator[None]:
    """A file or folder of the command line that is missing or refused is a UsageError."""
    try:
        yield
    except (FileNotFoundError, IsADirectoryError, NotADirectoryError, PermissionError) as error:
        raise UsageError(sentence(error)) from error


def exit_code(error: Exception) -> Exit | None:
    """The exit code of an error that its own sentence explains; None for an unexpected one.

    An error with ``usage`` says whether it is of the user's files and words, or of the machine.
    """
    usage = getattr(error, "usage", _is_no_utf8(error) or None)
    if usage is not None:
        return Exit.USAGE if usage else Exit.ERROR
    return Exit.ERROR if isinstance(error, OSError) else None


def sentence(error: Exception) -> str:
    """The error's own text; an error of the system without its number, with its file."""
    if isinstance(error, UnicodeEncodeError) and _is_no_utf8(error):
        return _of_no_utf8(error)
    if not isinstance(error, OSError):
        return str(error).rstrip("\n")
    place = f"{error.filename}: " if error.filename else ""
    return f"{place}{error.strerror or error}"


def _is_no_utf8(error: Exception) -> bool:
    return isinstance(error, UnicodeEncodeError) and error.reason == "surrogates not allowed"


def _of_no_utf8(error: UnicodeEncodeError) -> str:
    """The text may be a whole file, of which the name is one value."""
    begin = max(error.object.rfind(end, 0, error.start) for end in '"\n') + 1
    name = re.split(r'["\n]', error.object[begin:], maxsplit=1)[0]
    shown = os.fsencode(name).decode("utf-8", "backslashreplace")
    return f"'{shown}' is not UTF-8, as names of files and folders must be here: rename it"
