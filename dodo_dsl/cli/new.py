"""dodo new: write a new test, or what a repository with tests needs."""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TextIO

from dodo_dsl import package_data
from dodo_dsl.application.read import as_written
from dodo_dsl.cli import existing_application, new_files, new_test
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.cli.new_files import (
    ANSWERS,
    COMPOSE_FILES,
    LANGUAGES,
    REGISTRY,
    ROS,
    ROS_PYTHON,
    New,
    application_files,
    deployment_files,
    dodo_yml,
    missing_schemas,
    own_compose_file,
    ros_python,
    say_next,
    write_new,
)
from dodo_dsl.cli.new_test import copied_files, kinds, once, start
from dodo_dsl.compiler import Checked, load
from dodo_dsl.diagnostics import Diagnostic, format_text, shown_path
from dodo_dsl.spec.deployment import FILE_NAME, Deployment
from dodo_dsl.spec.model import KINDS, LEVEL_WORDS, LEVELS, Spec

_LEVELS = {**LEVEL_WORDS, "hil": f"{LEVEL_WORDS['hil']}, on a rig"}
_KINDS = {
    "closed-loop": "the application drives",
    "open-loop": "the application is carried along, and its signals are judged",
    "perception": "what the application finds in pictures is judged",
}
_NEW = "new"


@dataclass(frozen=True)
class Wanted:
    """The new test as it is asked for; ``extends`` is empty for a template."""

    name: str
    level: str = ""
    kind: str = ""
    extends: str = ""
    rec: Path | None = None


@dataclass(frozen=True)
class Questions:
    """Asks a person; an empty answer takes the choice in brackets. Raises UsageError at the end of the input."""

    stdin: TextIO
    stdout: TextIO
    check_name: Callable[[str], None]

    def ask(self, shipped: Sequence[Spec], known: Wanted) -> Wanted:
        """The test, with what is not ``known`` of it already."""
        if known.extends or known.rec:
            return replace(known, name=self._name(f"my-{known.extends}" if known.extends else "dil-first"))
        level = known.level or self._choice("level", list(_LEVELS.items()))
        kind = known.kind or self._choice("kind", [(name, _KINDS[name]) for name in kinds(level)])
        first = start(level, kind)
        copies = [spec for spec in once(shipped) if (spec.level, spec.kind) == (level, kind)]
        copies.sort(key=lambda spec: spec.name != first.shipped)
        own = [] if first.shipped else [(_NEW, "a short test to change")]
        chosen = self._choice("begin with", [*own, *((spec.name or "", spec.description or "") for spec in copies)])
        return Wanted(self._name(f"{level}-first"), level, kind, "" if chosen == _NEW else chosen)

    def _choice(self, what: str, rows: Sequence[tuple[str, str]]) -> str:
        width = max(len(name) for name, _ in rows)
        lines = [f"  {number}  {name.ljust(width)}  {text}\n" for number, (name, text) in enumerate(rows, 1)]
        self.stdout.write(f"{what}\n" + "".join(lines))
        names = [name for name, _ in rows]
        while True:
            answer = self._answer("number or name [1]: ") or "1"
            if answer in names:
                return answer
            if answer.isascii() and answer.isdigit() and 1 <= int(answer[:6]) <= len(names):
                return names[int(answer) - 1]
            self.stdout.write(f"'{answer}' is none of them, expected a number from 1 to {len(names)}\n")

    def _name(self, usual: str) -> str:
        while True:
            name = self._answer(f"name [{usual}]: ") or usual
            try:
                self.check_name(name)
            except UsageError as error:
                self.stdout.write(f"{error}\n")
            else:
                return name

    def _answer(self, prompt: str) -> str:
        self.stdout.write(prompt)
        self.stdout.flush()
        line = self.stdin.readline()
        if not line:
            self.stdout.write("\n")
            raise UsageError("nothing was written: the input ended before all questions were answered")
        return line.strip()


_NO_APPLICATION = (
    f"write your application's compose file, and name it in {FILE_NAME}: application: {COMPOSE_FILES[0]}\n"
    "      (dodo new --application, in an empty folder, writes a first application and a test)"
)


@dataclass(frozen=True)
class Destination:
    """The repository's root, the registry that takes the test, and the files that the repository lacks for it.

    ``todo`` says what the user has to do before the test can run, empty if an application is named and there.
    """

    root: Path
    registry: Path
    files: tuple[New, ...]
    todo: str = ""


def destination(checked: Checked) -> Destination:
    """Raises UsageError if ``dodo.yml`` is wrong or names no folder of the repository."""
    deployment = checked.deployment
    root = deployment.root.resolve()
    schemas = missing_schemas(root)
    if deployment.file is None:
        application = own_compose_file(root)
        files = (dodo_yml(root, application), *schemas)
        return Destination(root, root / REGISTRY, files, "" if application else _NO_APPLICATION)
    todo = "" if deployment.application else _NO_APPLICATION
    return Destination(root, _registry(deployment, checked.diagnostics), tuple(schemas), todo)


def _registry(deployment: Deployment, diagnostics: Sequence[Diagnostic]) -> Path:
    """The first registry that belongs to the repository itself, and not to a DoDo that is installed in it.

    One that does not exist yet counts if there is no other.
    """
    own = [d for d in diagnostics if d.span.file == str(deployment.file) and d.severity == "error"]
    wrong = [d for d in own if d.rule != "missing-file"]
    if wrong:
        raise UsageError(f"{FILE_NAME} has problems:\n{format_text(wrong)}")
    root = deployment.root.resolve()
    for registry in (*deployment.registry, *deployment.absent):
        if registry.resolve().is_relative_to(root) and not package_data.is_shipped(registry, root):
            return registry
    file = shown_path(str(deployment.file))
    raise UsageError(f'{file} names no folder for your own tests; add to it: registry: [{REGISTRY}, "dodo:"]')


_FIRST = "sil-first"
_BUILDS = {"cpp": ("cmake -B build", "cmake --build build --parallel --target steering")}
"""How programs are built that have to be."""
_TESTS = {answers: f"application/{answers}/{_FIRST}.dodo.yml" for answers in ("wheels", ROS)}
"""Templates of first tests other than the usual one, by how the application answers."""
_PUSH = "commit and push; GitLab runs the tests, on a runner with the tag sil"


def new_application(language: str, answers: str, stdout: TextIO, stderr: TextIO) -> int:
    root = Path.cwd()
    own = application_files(root, language, answers)
    usual = new_test.start(new_test.LEVEL, new_test.KIND).template
    first = new_test.test_files(_FIRST, _TESTS.get(answers, usual), root / REGISTRY, root)
    taken = [*(file.path for file in (*own, *first)), *(root / name for name in (*COMPOSE_FILES, FILE_NAME))]
    if there := [path for path in taken if path.exists()]:
        advice = "dodo new --deployment keeps what there is"
        raise UsageError(f"'{shown_path(str(there[0]))}' exists already; nothing was written; {advice}")
    made = {file.path for file in own}
    images = language in _BUILDS or answers == ROS
    around = [file for file in deployment_files(root, images=images, ros=answers == ROS) if file.path not in made]
    kept = [file for file in around if file.path.exists()]
    write_new([*own, *(file for file in around if file not in kept), *first], stdout)
    included = _say_kept(kept, images, stdout)
    program = next(file.path.name for file in own if file.path.stem == "steering")
    builds = _ros_builds(language) if answers == ROS else _BUILDS.get(language, ())
    steps = [*builds, f"dodo run {_FIRST}", f"make {program} and the test yours"]
    say_next([*steps, *included, _PUSH], stdout)
    return Exit.OK


def _ros_builds(language: str) -> tuple[str, ...]:
    if language == "cpp":
        return (". /opt/ros/kilted/setup.bash && colcon build",)
    script = f"PATH-OF-DODO'S-CHECKOUT/scripts/install-ros {ROS_PYTHON.partition('/')[0]}"
    return () if ros_python() != ROS_PYTHON else (f"{script}  (or take ROS' own Python, in dodo.yml)",)


def new_deployment(stdout: TextIO, stderr: TextIO) -> int:
    files = deployment_files(Path.cwd())
    there = [file for file in files if file.path.exists()]
    new = [file for file in files if file not in there]
    written = [file.path.name for file in new if file.path.name in COMPOSE_FILES]
    others = ", ".join(new_files.other_compose_files(Path.cwd())) if written else ""
    write_new(new, stdout)
    included = _say_kept(there, False, stdout)
    if not new:
        stdout.write("\nnothing to write\n")
        return Exit.OK
    instead = (
        f", or name those that you have in {FILE_NAME}, of {others}: application: {{files: [...]}}" if others else ""
    )
    named = [f"name your services in {name}{instead}" for name in written]
    named += [] if written or own_compose_file(Path.cwd()) else [_NO_APPLICATION]
    say_next([*named, *included, f"dodo new {_FIRST}", "dodo compile --check", _PUSH], stdout)
    return Exit.OK


def _say_kept(kept: Sequence[New], images: bool, stdout: TextIO) -> list[str]:
    """Says which files stay as they are, and what they lack; returns what the user has to do about the pipeline."""
    steps: list[str] = []
    for file in kept:
        stdout.write(f"kept: {shown_path(str(file.path))}{_lack(file)}\n")
        if file.path.name == new_files.PIPELINE:
            steps += filter(None, [new_files.kept_pipeline(file.path, images)])
    return steps


def _lack(file: New) -> str:
    lines = new_files.missing_lines(file) if file.path.name == new_files.IGNORED else []
    return f", which lacks {', '.join(lines)}" if lines else ""


EXAMPLES = """examples:
  dodo new                                             asks, or lists what a test can start from
  dodo new sil-my-curve                                a closed-loop simulation that compiles
  dodo new hil-my-curve --level hil                    the same on a rig, or emulated by dodo run --emulate
  dodo new sil-my-dark --extends sil-my-curve          a changed copy of another test
  dodo new dil-mine --level dil --rec drive.rec        your own recording, and its signal as the target
  dodo new dil-bag --level dil --rec bag               the same of a bag of ROS 2
  dodo new sil-mine --extends sil-closed-kiwi-track    a copy of a shipped test and its files
  dodo new --application                               an application that drives, with a test that it passes
  dodo new --application --language cpp                the same in C++, on libcluon
  dodo new --application --ros                         a ROS 2 node, in Python or with --language cpp
  dodo new --application --answers printed             one that prints its answers; wheels: two wheels, range sensors
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
        "--answers",
        choices=ANSWERS,
        help="how that application answers: steering and pedal on the bus, the same printed, or a pedal for each of "
        "two wheels, by range sensors (default: bus)",
    )
    parser.add_argument("--ros", action="store_true", help="that application is a ROS 2 node: pictures in, Twist out")
    parser.add_argument(
        "--level", choices=LEVELS, help="level of the new test: software, data or hardware in the loop (default: sil)"
    )
    parser.add_argument("--kind", choices=KINDS, help="kind of the new test (default: closed-loop)")
    parser.add_argument("--extends", metavar="TEST", help="test that the new one extends; a shipped one is copied")
    parser.add_argument(
        "--rec",
        metavar="FILE.rec",
        type=Path,
        help="recording, or bag of ROS 2, that a new dil test plays, with its target",
    )


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    for flag in ("language", "answers", "ros"):
        if getattr(options, flag) and not options.application:
            raise UsageError(f"--{flag} applies to --application")
    if options.ros and options.answers:
        raise UsageError("--answers applies to OpenDLV applications: with --ros the answer is a Twist")
    if options.deployment or options.application:
        if options.level or options.kind or options.extends or options.rec:
            words = "--level, --kind, --extends and --rec"
            raise UsageError(f"{words} apply to a test, not to --deployment and --application")
        if options.deployment:
            return new_deployment(stdout, stderr)
        answers = ROS if options.ros else options.answers or ANSWERS[0]
        return new_application(options.language or LANGUAGES[0], answers, stdout, stderr)
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
        stdout.write(new_test.listing(tests.shipped.specs))
        return Exit.USAGE
    place = destination(checked)
    wanted = Wanted(options.name or "", options.level or "", options.kind or "", options.extends or "", options.rec)
    if options.name is None:
        questions = Questions(sys.stdin, stdout, lambda name: new_test.check_name(name, taken))
        wanted = questions.ask(tests.shipped.specs, wanted)
    new_test.check_name(wanted.name, taken)
    made, note = _files(wanted, tests, place)
    there = [file.path for file in made if file.path.exists()]
    if there:
        raise UsageError(f"'{shown_path(str(there[0]))}' exists already; nothing was written")
    write_new([*place.files, *made], stdout)
    stdout.write(note)
    todo = [place.todo] if place.todo else []
    spec = shown_path(str(made[0].path))
    emulate = " --emulate" if wanted.level == "hil" and not checked.deployment.rigs else ""
    say_next([f"make {spec} yours", "dodo compile --check", *todo, f"dodo run {wanted.name}{emulate}"], stdout)
    return Exit.OK


def _files(wanted: Wanted, tests: _Tests, place: Destination) -> tuple[list[New], str]:
    """The test's own files, its spec first; with a note for the user."""
    there = own_compose_file(place.root) if tests.checked.deployment.file is None else ""
    application = tests.checked.application or (as_written(place.root / there) if there else None)
    pictures = existing_application.pictures(application)
    if wanted.rec:
        from dodo_dsl.cli import recorded_drive  # slow to load, and rarely needed

        declared = [*application.declared.values()] if application else []
        sent = {name.partition("/")[0] for own in declared if own for name, _ in own.outputs}
        with recorded_drive.recording_of(wanted.rec) as (rec, imported):
            drive = recorded_drive.look(rec, sent)
            of_ros = any(own.topics for own in declared if own)
            made, note = recorded_drive.files(wanted.name, rec, drive, place.registry, place.root, pictures, of_ros)
        note = imported + note + (pictures.note if drive.cameras else "")
        return made, note + recorded_drive.unpassable(rec, drive, application, pictures)
    if wanted.extends:
        note = f"copied, because '{wanted.extends}' ships with DoDo and a test extends only tests of its own registry\n"
        return _from_another(wanted.name, wanted.extends, tests, place, note)
    start = new_test.start(wanted.level or new_test.LEVEL, wanted.kind or new_test.KIND, wanted.name)
    if start.shipped:
        note = f"copied from '{start.shipped}', because a {start.level} test of kind {start.kind} {start.why}\n"
        return _from_another(wanted.name, start.shipped, tests, place, note)
    return new_test.test_files(wanted.name, start.template, place.registry, place.root, pictures), pictures.note


def _from_another(name: str, base_name: str, tests: _Tests, place: Destination, note: str) -> tuple[list[New], str]:
    """A test that extends one of the repository, or a copy of one that ships with DoDo, which ``note`` explains."""
    base = new_test.base_test(base_name, [*tests.own, *tests.copied])
    if not package_data.is_shipped(base.location.root, place.root):
        if not base.location.root.resolve().is_relative_to(place.root):
            raise UsageError(f"'{base_name}' is outside this repository; a test extends tests of its registry")
        return new_test.extending_files(name, base, place.root), ""
    instances = [spec for spec in tests.copied if spec.path == base.path]
    return copied_files(name, instances, tests.shipped.manifests, place.registry, place.root), note
