"""``dodo images builds``: the application's builds, checked, as a compose file for ``docker buildx bake``."""

import argparse
import json
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

from dodo_dsl import compiler
from dodo_dsl.application import hidden_paths
from dodo_dsl.application.construction import checked_builds
from dodo_dsl.application.interpolation import EnvironmentProblem
from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.application.read import read_application
from dodo_dsl.cli import selection
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.diagnostics import format_text, has_errors
from dodo_dsl.run.docker.builds import HiddenContext, own_contexts
from dodo_dsl.run.hidden_paths import of_repository
from dodo_dsl.spec.deployment import Deployment


def add(parser: argparse.ArgumentParser) -> None:
    selection.add_application(parser)
    parser.add_argument(
        "--contexts", type=Path, metavar="DIR",
        help="build from copies in this folder, without tests, reports, compiled tests and .git: keep it until the "
        "images are built (default: the folders themselves)"
    )  # fmt: skip


def show(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    """Writes the application's checked builds as a compose file; raises UsageError if there is no application."""
    deployment = selection.checked_deployment()
    files = selection.existing_files(options.application) or deployment.application
    if not files:
        raise compiler.NoApplication
    source, problems = read_application(
        files, compiler.access(deployment), deployment.sandbox, declarations=deployment.declarations
    )
    stderr.write(format_text(problems))
    if source is None or has_errors(problems):
        return Exit.PROBLEMS
    try:
        builds = checked_builds(source)
    except EnvironmentProblem as error:
        raise UsageError(f"the application's builds: {error}") from error
    if options.contexts:
        builds = _own_contexts(builds, _hidden(source, deployment, files), options.contexts)
    stdout.write(json.dumps(builds, indent=2) + "\n")
    return Exit.OK


def _own_contexts(builds: dict[str, Any], hidden: Sequence[Path], folder: Path) -> dict[str, Any]:
    """The same builds with their own contexts in a folder; raises UsageError if it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        own = Path(tempfile.mkdtemp(dir=folder))
        return {**builds, "services": own_contexts(builds["services"], hidden, own.resolve(), Path.cwd())}
    except (HiddenContext, OSError, shutil.Error) as error:
        raise UsageError(f"--contexts: {error}") from error


def _hidden(source: ApplicationSource, deployment: Deployment, files: Sequence[Path]) -> list[Path]:
    """What builds do not get; raises UsageError where tests among the application's own files cannot be compiled."""
    own = source.folder.resolve()
    roots = [own, *(root.resolve() for root in source.paths.roots)]
    found = [*hidden_paths.unseen(source, deployment), *of_repository(roots)]
    if any(own.is_relative_to(folder.resolve()) for folder in deployment.registry):
        checked = compiler.without_unsatisfied(compiler.load((), files))
        if not checked.ok or has_errors((made := compiler.plan(checked, own / "generated")).problems):
            raise UsageError("the tests beside the application cannot be compiled; dodo compile --check says why")
        found += [own / path for plan in made.compiled.suite.plans[:1] for path in plan.application.hidden]
    return found
