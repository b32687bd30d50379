"""dodo new: write a new test, or what a repository with tests needs."""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from dodo_dsl import package_data
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.exits import Exit
from dodo_dsl.cli.new import scaffold, starts
from dodo_dsl.cli.new.destination import Destination, destination
from dodo_dsl.cli.new.new_file import New
from dodo_dsl.cli.new.new_repository import new_application, new_deployment
from dodo_dsl.cli.new.questions import Questions, Wanted
from dodo_dsl.cli.new.repository_files import LANGUAGES
from dodo_dsl.cli.new.shipped_copy import copied_files
from dodo_dsl.cli.new.writing import say_next, write
from dodo_dsl.compiler import Checked, load
from dodo_dsl.diagnostics import shown_path
from dodo_dsl.spec.model import KINDS, LEVELS, Spec

EXAMPLES = """examples:
  dodo new                                             asks, or lists what a test may begin with
  dodo new sil-my-curve                                a closed-loop simulation that compiles
  dodo new hil-my-curve --level hil                    the same on a rig, at first the emulated one
  dodo new sil-my-dark --extends sil-my-curve          a changed copy of another test
  dodo new dil-mine --level dil --rec drive.rec        a recording of one's own, and its signal as the target
  dodo new sil-mine --extends sil-closed-kiwi-track    a copy of a shipped test and its files
  dodo new --application                               an application that drives, with a test that it passes
  dodo new --application --language cpp                the same in C++, on libcluon
  dodo new --deployment                                dodo.yml, application and pipeline in this folder
"""


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
    parser.add_argument(
        "--language", choices=LANGUAGES, help="language of the application that --application writes (default: python)"
    )
    parser.add_argument(
        "--level", choices=LEVELS, help="level of the new test: software, data or hardware in the loop (default: sil)"
    )
    parser.add_argument("--kind", choices=KINDS, help="kind of the new test (default: closed-loop)")
    parser.add_argument("--extends", metavar="TEST", help="test that the new one changes; a shipped one is copied")
    parser.add_argument(
        "--rec", metavar="FILE.rec", type=Path, help="recording that a new dil test plays, and takes its target from"
    )


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    if options.language and not options.application:
        raise UsageError("--language applies to --application")
    if options.deployment or options.application:
        if options.level or options.kind or options.extends or options.rec:
            words = "--level, --kind, --extends and --rec"
            raise UsageError(f"{words} apply to a test, not to --deployment and --application")
        if options.deployment:
            return new_deployment(stdout, stderr)
        return new_application(options.language or LANGUAGES[0], stdout, stderr)
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


def _refuse_contradictions(options: argparse.Namespace) -> None:
    if options.extends and (options.level or options.kind or options.rec):
        raise UsageError("--level, --kind and --rec do not apply with --extends: they are those of the extended test")
    if options.rec and options.level not in (None, "dil"):
        raise UsageError(f"a recording is played at level dil, not {options.level}")
    if options.rec and options.kind not in (None, "open-loop"):
        hint = "; a perception test needs true boxes as well, see --extends dil-static-rig" * (
            options.kind != "closed-loop"
        )
        raise UsageError(f"--rec begins an open-loop test, not a {options.kind} one{hint}")


def _test(options: argparse.Namespace, stdout: TextIO) -> int:
    _refuse_contradictions(options)
    checked = load([])
    tests = _Tests(checked, load([package_data.registry()]), checked.deployment.root.resolve())
    taken = [spec.location.stem for spec in checked.specs]
    if options.name is None and not (sys.stdin.isatty() and stdout.isatty()):
        stdout.write(starts.listing(tests.shipped.specs))
        return Exit.USAGE
    place = destination(checked)
    wanted = Wanted(options.name or "", options.level or "", options.kind or "", options.extends or "", options.rec)
    if options.name is None:
        questions = Questions(sys.stdin, stdout, lambda name: scaffold.check_name(name, taken))
        wanted = questions.ask(tests.shipped.specs, wanted)
    scaffold.check_name(wanted.name, taken)
    made, note = _files(wanted, tests, place)
    there = [file.path for file in made if file.path.exists()]
    if there:
        raise UsageError(f"'{shown_path(str(there[0]))}' exists already; nothing was written")
    write([*place.files, *made], stdout)
    stdout.write(note)
    todo = [place.todo] if place.todo else []
    spec = shown_path(str(made[0].path))
    say_next([f"make {spec} yours", "dodo compile --check", *todo, f"dodo run {wanted.name}"], stdout)
    return Exit.OK


def _files(wanted: Wanted, tests: _Tests, place: Destination) -> tuple[list[New], str]:
    """The test's own files, its spec first; with a note for the user."""
    if wanted.rec:
        from dodo_dsl.cli.new import recorded_drive  # slow to load, and rarely needed

        declared = tests.checked.application.declared.values() if tests.checked.application else ()
        sent = {name.partition("/")[0] for own in declared if own for name, _ in own.outputs}
        drive = recorded_drive.look(wanted.rec, sent)
        made, note = recorded_drive.files(wanted.name, wanted.rec, drive, place.registry, place.root)
        return made, note + recorded_drive.unpassable(wanted.rec, drive, tests.checked.application)
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
