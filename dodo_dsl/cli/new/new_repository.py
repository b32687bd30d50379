"""``dodo new --deployment`` and ``--application``: what a repository with tests needs, in the working folder."""

from pathlib import Path
from typing import TextIO

from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.exits import Exit
from dodo_dsl.cli.new import scaffold, starts
from dodo_dsl.cli.new.repository_files import COMPOSE_FILES, REGISTRY, application_files, deployment_files
from dodo_dsl.cli.new.writing import say_next, write
from dodo_dsl.diagnostics import shown_path
from dodo_dsl.spec.deployment.deployment import FILE_NAME

_FIRST = "sil-first"
_BUILDS = {"cpp": ("cmake -B build", "cmake --build build --parallel --target steering")}
"""How programs are built that have to be."""


def new_application(language: str, stdout: TextIO) -> int:
    root = Path.cwd()
    own = application_files(root, language)
    first = scaffold.test_files(_FIRST, starts.start(starts.LEVEL, starts.KIND).template, root / REGISTRY, root)
    taken = [*(file.path for file in (*own, *first)), *(root / name for name in (*COMPOSE_FILES, FILE_NAME))]
    if there := [path for path in taken if path.exists()]:
        advice = "dodo new --deployment keeps what there is"
        raise UsageError(f"'{shown_path(str(there[0]))}' exists already; nothing was written; {advice}")
    made = {file.path for file in own}
    around = deployment_files(root, images=language in _BUILDS)
    write([*own, *(f for f in around if f.path not in made and not f.path.exists()), *first], stdout)
    program = next(file.path.name for file in own if file.path.stem == "steering")
    steps = [*_BUILDS.get(language, ()), f"dodo run {_FIRST}", f"make {program} and the test yours"]
    say_next([*steps, "commit and push; GitLab runs it"], stdout)
    return Exit.OK


def new_deployment(stdout: TextIO) -> int:
    files = deployment_files(Path.cwd())
    there = [file for file in files if file.path.exists()]
    write([file for file in files if file not in there], stdout)
    for file in there:
        stdout.write(f"kept: {shown_path(str(file.path))}\n")
    if len(there) == len(files):
        stdout.write("\nnothing to write\n")
        return Exit.OK
    steps = [f"name your services in {next(f.path.name for f in files if f.path.name in COMPOSE_FILES)}"]
    if any(file.path.name == ".gitlab-ci.yml" for file in there):
        steps.append("include .gitlab/dodo/deployment.gitlab-ci.yml in .gitlab-ci.yml")
    say_next([*steps, "dodo new sil-first", "dodo compile --check", "commit and push; GitLab runs it"], stdout)
    return Exit.OK
