"""dodo new: write a new test, or what a repository with tests needs."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from dodo_dsl import package_data
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.exits import Exit
from dodo_dsl.cli.new import scaffold, starts
from dodo_dsl.cli.new.destination import Destination, destination
from dodo_dsl.cli.new.new_file import New
from dodo_dsl.cli.new.questions import Questions, Wanted
from dodo_dsl.cli.new.repository_files import COMPOSE_FILES, REGISTRY, application_files, deployment_files
from dodo_dsl.cli.new.shipped_copy import copied_files
from dodo_dsl.compiler import Checked, load
from dodo_dsl.diagnostics import shown_path
from dodo_dsl.spec.model import KINDS, LEVELS, Spec

EXAMPLES = """examples:
  dodo new                                             asks, or lists what a test may begin with
  dodo new sil-my-curve                                a closed-loop simulation that compiles
  dodo new hil-my-curve --level hil                    the same on a rig, at first the emulated one
  dodo new sil-my-dark --extends sil-my-curve          a changed copy of another test
  dodo new sil-mine --extends sil-closed-kiwi-track    a copy of a shipped test and its files
  dodo new --application                               an application that drives, with a test that it passes
  dodo new --deployment                                dodo.yml, application and pipeline in this folder
"""

_FIRST = "sil-first"


def add(parser: argparse.ArgumentParser) -> None:
    what = parser.add_mutually_exclusive_group()
    what.add_argument("name", nargs="?", metavar="NAME", help="name of the new test; without it, DoDo asks")
    what.add_argument(
        "--deployment", action="store_true", help="write what a repository with tests needs into this folder"
    )
    what.add_argument(
        "--application",
        action="store_true",
        help="write a small application, its pipeline and a first test that it passes",
    )
    parser.add_argument("--level", choices=LEVELS, help="level of the new test (default: sil)")
    parser.add_argument("--kind", choices=KINDS, help="kind of the new test (default: closed-loop)")
    parser.add_argument("--extends", metavar="TEST", help="test that the new one changes; a shipped one is copied")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    if options.deployment or options.application:
        if options.level or options.kind or options.extends:
            raise UsageError("--level, --kind and --extends apply to a test, not to --deployment and --application")
        return _deployment(stdout) if options.deployment else _application(stdout)
    return _test(options, stdout)


@dataclass(frozen=True)
class _Tests:
    """The repository's tests, and those that ship with DoDo."""

    checked: Checked
    shipped: Checked
    root: Path

    @property
    def copied(self) -> list[Spec]:
        """The shipped tests, which are copied; none where DoDo's own repository is the one that has them."""
        return [spec for spec in self.shipped.specs if package_data.is_shipped(spec.location.root, self.root)]

    @property
    def own(self) -> list[Spec]:
        return [spec for spec in self.checked.specs if not package_data.is_shipped(spec.location.root, self.root)]


def _test(options: argparse.Namespace, stdout: TextIO) -> int:
    if options.extends and (options.level or options.kind):
        raise UsageError("--level and --kind do not apply with --extends: they are those of the extended test")
    checked = load([])
    tests = _Tests(checked, load([package_data.registry()]), checked.deployment.root.resolve())
    taken = [spec.location.stem for spec in checked.specs]
    if options.name is None and not (sys.stdin.isatty() and stdout.isatty()):
        stdout.write(starts.listing(tests.shipped.specs))
        return Exit.USAGE
    place = destination(checked)
    wanted = Wanted(options.name or "", options.level or "", options.kind or "", options.extends or "")
    if options.name is None:
        questions = Questions(sys.stdin, stdout, lambda name: scaffold.check_name(name, taken))
        wanted = questions.ask(tests.shipped.specs, wanted)
    scaffold.check_name(wanted.name, taken)
    made, note = _files(wanted, tests, place)
    there = [file.path for file in made if file.path.exists()]
    if there:
        raise UsageError(f"'{shown_path(str(there[0]))}' exists already; nothing was written")
    _write([*place.files, *made], stdout)
    stdout.write(note)
    todo = [place.todo] if place.todo else []
    spec = shown_path(str(made[0].path))
    _next([f"make {spec} yours", "dodo compile --check", *todo, f"dodo run {wanted.name}"], stdout)
    return Exit.OK


def _files(wanted: Wanted, tests: _Tests, place: Destination) -> tuple[list[New], str]:
    """The test's own files, its spec first; with a note for the user."""
    if wanted.extends:
        note = f"copied, because '{wanted.extends}' ships with DoDo and a test extends only tests of its own registry\n"
        return _from_another(wanted.name, wanted.extends, tests, place, note)
    start = starts.start(wanted.level or starts.LEVEL, wanted.kind or starts.KIND, wanted.name)
    if start.shipped:
        note = f"copied from '{start.shipped}', because a {start.level} test of kind {start.kind} {start.why}\n"
        return _from_another(wanted.name, start.shipped, tests, place, note)
    return scaffold.test_files(wanted.name, start.template, place.registry, place.root), ""


def _from_another(name: str, base_name: str, tests: _Tests, place: Destination, note: str) -> tuple[list[New], str]:
    """A test that extends one of the repository, or a copy of one that ships with DoDo, which ``note`` explains."""
    base = scaffold.base_test(base_name, [*tests.own, *tests.copied])
    if not package_data.is_shipped(base.location.root, place.root):
        if not base.location.root.resolve().is_relative_to(place.root):
            raise UsageError(f"'{base_name}' is outside this repository; a test extends tests of its registry")
        return scaffold.extending_files(name, base, place.root), ""
    instances = [spec for spec in tests.copied if spec.path == base.path]
    return copied_files(name, instances, tests.shipped.manifests, place.registry, place.root), note


def _application(stdout: TextIO) -> int:
    root = Path.cwd()
    own = application_files(root)
    first = scaffold.test_files(_FIRST, starts.start(starts.LEVEL, starts.KIND).template, root / REGISTRY, root)
    there = [
        path for path in (*(file.path for file in (*own, *first)), *(root / n for n in COMPOSE_FILES)) if path.exists()
    ]
    if there:
        advice = "dodo new --deployment keeps what there is"
        raise UsageError(f"'{shown_path(str(there[0]))}' exists already; nothing was written; {advice}")
    made = {file.path for file in own}
    files = [*own, *(f for f in deployment_files(root) if f.path not in made and not f.path.exists()), *first]
    _write(files, stdout)
    _next([f"dodo run {_FIRST}", "make steering.py and the test yours", "commit and push; GitLab runs it"], stdout)
    return Exit.OK


def _deployment(stdout: TextIO) -> int:
    files = deployment_files(Path.cwd())
    there = [file for file in files if file.path.exists()]
    _write([file for file in files if file not in there], stdout)
    for file in there:
        stdout.write(f"kept: {shown_path(str(file.path))}\n")
    if len(there) == len(files):
        stdout.write("\nnothing to write\n")
        return Exit.OK
    steps = [f"name your services in {next(f.path.name for f in files if f.path.name in COMPOSE_FILES)}"]
    if any(file.path.name == ".gitlab-ci.yml" for file in there):
        steps.append("include .gitlab/dodo/deployment.gitlab-ci.yml in .gitlab-ci.yml")
    _next([*steps, "dodo new sil-first", "dodo compile --check", "commit and push; GitLab runs it"], stdout)
    return Exit.OK


def _write(files: Sequence[New], stdout: TextIO) -> None:
    """Writes new files, none of which may be there."""
    for file in files:
        file.path.parent.mkdir(parents=True, exist_ok=True)
        with file.path.open("xb") as stream:
            stream.write(file.content)
        stdout.write(f"wrote {shown_path(str(file.path))}\n")


def _next(steps: Sequence[str], stdout: TextIO) -> None:
    stdout.write("\nnext: " + "\n      ".join(steps) + "\n")
