"""``dodo images builds``: the application's builds as a compose file, after they are checked."""

import argparse
import json
from typing import TextIO

from dodo_dsl import compiler
from dodo_dsl.application.read import read_application
from dodo_dsl.cli import selection
from dodo_dsl.cli.errors import NO_APPLICATION, UsageError
from dodo_dsl.cli.exits import Exit
from dodo_dsl.diagnostics import format_text, has_errors
from dodo_dsl.plan.rewrite.checked_builds import checked_builds

add = selection.add_application


def show(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    """Writes the builds; raises UsageError where there is no application."""
    deployment = selection.checked_deployment()
    files = selection.existing_files(options.application) or deployment.application
    if not files:
        raise UsageError(NO_APPLICATION)
    source, problems = read_application(files, compiler.access(deployment), deployment.sandbox)
    stderr.write(format_text(problems))
    if source is None or has_errors(problems):
        return Exit.PROBLEMS
    builds, problems = checked_builds(source)
    stderr.write(format_text(problems))
    if has_errors(problems):
        return Exit.PROBLEMS
    stdout.write(json.dumps(builds, indent=2) + "\n")
    return Exit.OK
