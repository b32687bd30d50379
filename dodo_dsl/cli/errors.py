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
    """The exit code for tests that passed, failed or ended in error."""
    kinds = set(outcomes)
    return Exit.ERROR if "error" in kinds else Exit.PROBLEMS if "failed" in kinds else Exit.OK


class UsageError(Exception):
    """A command line or a file that it names is wrong; one sentence, exit code 2."""


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
    """The exit code of an error that its own sentence explains; None for an unexpected one."""
    if isinstance(error, UsageError) or _is_no_utf8(error):
        return Exit.USAGE
    if isinstance(error, _usage_errors()) or getattr(error, "usage", False):
        return Exit.USAGE
    return Exit.ERROR if isinstance(error, (OSError, *_machine_errors())) else None


def sentence(error: Exception) -> str:
    """The error's own text; an error of the system without its number, with its file."""
    if isinstance(error, UnicodeEncodeError) and _is_no_utf8(error):
        return _of_no_utf8(error)
    if not isinstance(error, OSError):
        return str(error).rstrip("\n")
    place = f"{error.filename}: " if error.filename else ""
    return f"{place}{error.strerror or error}"


def _is_no_utf8(error: Exception) -> bool:
    """Whether the bytes of a name, which are not UTF-8, were to be written as text."""
    return isinstance(error, UnicodeEncodeError) and error.reason == "surrogates not allowed"


def _of_no_utf8(error: UnicodeEncodeError) -> str:
    """The text may be a whole file, of which the name is one value."""
    begin = max(error.object.rfind(end, 0, error.start) for end in '"\n') + 1
    name = re.split(r'["\n]', error.object[begin:], maxsplit=1)[0]
    shown = os.fsencode(name).decode("utf-8", "backslashreplace")
    return f"'{shown}' is not UTF-8, as names of files and folders must be here: rename it"


def _usage_errors() -> tuple[type[Exception], ...]:
    """Errors of the user's files and words."""
    from dodo_dsl.atomic import NotReplaceable, OutputExists
    from dodo_dsl.opendlv.odvd import OdvdError
    from dodo_dsl.opendlv.recording import RecordingError
    from dodo_dsl.opendlv.regular_file import NotAFile
    from dodo_dsl.opendlv.ros_codec import RosTypeError
    from dodo_dsl.plan.test_files import FilesError
    from dodo_dsl.rec.coco import LabelError
    from dodo_dsl.rec.frames import FramesError
    from dodo_dsl.rec.recording_filter import NothingSelected
    from dodo_dsl.rec.steering import SplitError
    from dodo_dsl.rec.truth import TruthError
    from dodo_dsl.report.child_jobs import NoChildJobs
    from dodo_dsl.report.results import ResultsError
    from dodo_dsl.spec.registry import RegistryError

    recordings = (
        RecordingError,
        OdvdError,
        NothingSelected,
        LabelError,
        FramesError,
        OutputExists,
        SplitError,
        TruthError,
        NotAFile,
        RosTypeError,
        NotReplaceable,
    )
    return (*recordings, FilesError, ResultsError, NoChildJobs, RegistryError)


def _machine_errors() -> tuple[type[Exception], ...]:
    """Errors of the machine, its engine, rigs and databases. ``usage`` of a rig's error makes it one of the user."""
    from dodo_dsl.images.build_context import WheelsError
    from dodo_dsl.images.docker_command import DockerError
    from dodo_dsl.run.protocol import BackendError
    from dodo_dsl.search.store import StorageProblem

    return DockerError, WheelsError, BackendError, StorageProblem
