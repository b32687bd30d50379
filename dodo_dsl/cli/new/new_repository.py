"""``dodo new --deployment`` and ``--application``: what a repository with tests needs, in the working folder."""

from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.exits import Exit
from dodo_dsl.cli.new import kept_files, scaffold, starts
from dodo_dsl.cli.new.new_file import New
from dodo_dsl.cli.new.repository_files import COMPOSE_FILES, REGISTRY, application_files, deployment_files, included
from dodo_dsl.cli.new.writing import say_next, write
from dodo_dsl.diagnostics import shown_path
from dodo_dsl.spec.deployment.deployment import FILE_NAME

_FIRST = "sil-first"
_BUILDS = {"cpp": ("cmake -B build", "cmake --build build --parallel --target steering")}
"""How programs are built that have to be."""
_PUSH = "commit and push; GitLab runs the tests, on a runner with the tag sil"


def new_application(language: str, stdout: TextIO, stderr: TextIO) -> int:
    root = Path.cwd()
    own = application_files(root, language)
    first = scaffold.test_files(_FIRST, starts.start(starts.LEVEL, starts.KIND).template, root / REGISTRY, root)
    taken = [*(file.path for file in (*own, *first)), *(root / name for name in (*COMPOSE_FILES, FILE_NAME))]
    if there := [path for path in taken if path.exists()]:
        advice = "dodo new --deployment keeps what there is"
        raise UsageError(f"'{shown_path(str(there[0]))}' exists already; nothing was written; {advice}")
    made = {file.path for file in own}
    images = language in _BUILDS
    around = [file for file in deployment_files(root, images=images) if file.path not in made]
    kept = [file for file in around if file.path.exists()]
    write([*own, *(file for file in around if file not in kept), *first], stdout)
    included = _say_kept(kept, images, stdout, stderr)
    program = next(file.path.name for file in own if file.path.stem == "steering")
    steps = [*_BUILDS.get(language, ()), f"dodo run {_FIRST}", f"make {program} and the test yours"]
    say_next([*steps, *included, _PUSH], stdout)
    return Exit.OK


def new_deployment(stdout: TextIO, stderr: TextIO) -> int:
    files = deployment_files(Path.cwd())
    there = [file for file in files if file.path.exists()]
    new = [file for file in files if file not in there]
    write(new, stdout)
    included = _say_kept(there, False, stdout, stderr)
    if not new:
        stdout.write("\nnothing to write\n")
        return Exit.OK
    named = [f"name your services in {file.path.name}" for file in new if file.path.name in COMPOSE_FILES]
    say_next([*named, *included, f"dodo new {_FIRST}", "dodo compile --check", _PUSH], stdout)
    return Exit.OK


def _say_kept(kept: Sequence[New], images: bool, stdout: TextIO, stderr: TextIO) -> list[str]:
    """Says which files stay as they are, and what they lack; returns what the user has to do about the pipeline."""
    steps = []
    for file in kept:
        stdout.write(f"kept: {shown_path(str(file.path))}{_lack(file)}\n")
        if file.path.name == kept_files.PIPELINE:
            pipeline = kept_files.pipeline(file.path)
            if pipeline.warning:
                stderr.write(f"warning: {pipeline.warning}\n")
            if not pipeline.includes_dodo:
                steps.append(pipeline.step(included(images)))
    return steps


def _lack(file: New) -> str:
    lines = kept_files.missing_lines(file) if file.path.name == kept_files.IGNORED else []
    return f", which lacks {', '.join(lines)}" if lines else ""
