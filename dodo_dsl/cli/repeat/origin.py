"""Where a run comes from: its command, and the folders of its application and tests."""

import argparse
import contextlib
import platform
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from dodo_dsl import __version__
from dodo_dsl.cli.repeat.command_line import command_line
from dodo_dsl.cli.repeat.repositories import asking
from dodo_dsl.report.run_record import RunRecord
from dodo_dsl.spec.deployment.deployment import Deployment


@dataclass(frozen=True)
class Origin:
    """``folders`` are by what is in them."""

    command: str
    folders: Mapping[str, Path] = field(default_factory=dict)


def origin(options: argparse.Namespace, deployment: Deployment) -> Origin:
    """Of the options of ``dodo run``."""
    files = [] if options.compiled else [*(options.application or deployment.application)]
    application = {"application": files[0].resolve().parent} if files else {}
    return Origin(command_line(options), {**application, "tests": (options.compiled or [deployment.root])[0].resolve()})


@contextlib.contextmanager
def recording(origin: Origin) -> Iterator[Callable[[], RunRecord]]:
    """What makes the record of a run that begins now, at its end."""
    date = datetime.now(UTC).isoformat(timespec="seconds")
    with asking(origin.folders) as repositories:
        yield lambda: RunRecord(date, platform.node(), __version__, origin.command, repositories.answers())
