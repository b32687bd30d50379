"""What is said of an error that ends a service: what is wrong, where in the service's own code, and the way there."""

import logging
import traceback
from collections.abc import Iterator
from pathlib import Path

from google.protobuf.message import Message

_OURS = ("dodo_dsl.", "services.")
_BASE = Path(__file__).resolve().parent


def tell(error: Exception, folder: Path, *, expected: bool, verbose: bool) -> None:
    """Logs the error; the last line is one sentence. ``expected`` tells that its own text is one for users."""
    if verbose:
        logging.error("the whole traceback", exc_info=error)
    elif not expected and (steps := short_traceback(error, folder)):
        logging.error("%s", steps)
    logging.critical("%s", " ".join(str(error).split()) if expected else sentence(error, folder))


def sentence(error: Exception, folder: Path) -> str:
    """The error in one line, with the innermost place in the service's own code; ``folder`` is the service's.

    Where its own code only called ``run``, as when it made a verdict that cannot be sent, it is the place in the base.
    """
    text = f"{type(error).__name__}: {_unknown_field(error) or ' '.join(str(error).split())}"
    places = [f"{file}:{frame.lineno}, in {frame.name}" for file, frame in _frames(error, folder)]
    return f"{text} ({places[-1]})" if places else text


def short_traceback(error: Exception, folder: Path) -> str:
    """These frames as Python prints them; empty where there are none."""
    lines = [f'  File "{file}", line {f.lineno}, in {f.name}\n    {f.line}' for file, f in _frames(error, folder)]
    return "\n".join(["Traceback without libraries (most recent call last):", *lines]) if lines else ""


def _frames(error: Exception, folder: Path) -> list[tuple[str, traceback.FrameSummary]]:
    """The frames of the service's own code, or else of the base; none for errors whose text is a sentence for users."""
    if type(error).__module__.startswith(_OURS):
        return []
    return list(_within(folder.resolve().parent, error)) or list(_within(_BASE.parent, error))


def _within(services: Path, error: Exception) -> Iterator[tuple[str, traceback.FrameSummary]]:
    """The frames below a folder of services but for the call of ``run``, with files relative to the folder above."""
    for frame in traceback.extract_tb(error.__traceback__):
        path = Path(frame.filename).resolve()
        if path.is_relative_to(services) and frame.name != "<module>":
            yield path.relative_to(services.parent).as_posix(), frame


def _unknown_field(error: Exception) -> str:
    """What is wrong where a message has no field of the name that was read; empty for anything else."""
    if not isinstance(error, AttributeError) or not isinstance(error.obj, Message):
        return ""
    about = error.obj.DESCRIPTOR
    fields = ", ".join(field.name for field in about.fields)
    return f"{about.full_name} has no field '{error.name}'; it has {fields or 'no fields'}"
