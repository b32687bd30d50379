"""The messages that ``dodo rec`` knows: a set by version, those of files, and those of the repository around it."""

from collections.abc import Callable, Sequence
from pathlib import Path

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.opendlv.messages import versions
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.odvd.parser import OdvdError
from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.spec.deployment.deployment import find_deployment, load_deployment

Tell = Callable[[str], None]


def messages_for(recording: Recording, wanted: Sequence[str], tell: Tell) -> tuple[str, MessageSet]:
    """The version of the set and its messages; ``wanted`` are versions and ODVD files of the command line.

    The ODVD files of the nearest ``dodo.yml`` are added. If they cannot be used, ``tell`` gets a sentence, and the rest
    is used without them. Raises OdvdError for files of the command line.
    """
    chosen = [word for word in wanted if word in (versions.OLD, versions.NEW)]
    files = [Path(word) for word in wanted if word not in chosen]
    version = chosen[-1] if chosen else versions.version_of(recording)
    messages = versions.load(version, *files)
    deployment = find_deployment(Path.cwd())
    if deployment is None:
        return version, messages
    try:
        return version, versions.load(version, *_own(deployment, tell), *files)
    except OdvdError as error:
        tell(f"{error}; the messages of {deployment} are skipped")
        return version, messages


def _own(path: Path, tell: Tell) -> tuple[Path, ...]:
    """The ODVD files that a ``dodo.yml`` names, as ``dodo run`` takes them; none if it would refuse the file."""
    deployment, problems = load_deployment(path)
    errors = [problem for problem in problems if problem.severity == "error"]
    if errors:
        tell(f"{_place(errors[0])}: {errors[0].message}; its messages are skipped")
        return ()
    return deployment.messages


def _place(problem: Diagnostic) -> str:
    return f"{problem.span.file}:{problem.span.line}:{problem.span.column}"
