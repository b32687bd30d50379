"""dodo new: write a new test, a map, an application, or a pipeline."""

import argparse
import importlib.util
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

from dodo_dsl import __version__, package_data
from dodo_dsl.application.read import as_written
from dodo_dsl.cli import existing_application
from dodo_dsl.cli.errors import Exit, UsageError, files_of_the_user
from dodo_dsl.cli.new_files import (
    SCHEMA_FOLDERS,
    SCHEMAS,
    New,
    copied_files,
    extending_files,
    filled,
    filled_folder,
    map_files,
    say_next,
    spec_files,
    world_files,
    write_new,
)
from dodo_dsl.compiler import Checked, load
from dodo_dsl.diagnostics import did_you_mean, format_text, shown_path
from dodo_dsl.spec.deployment import FILE_NAME
from dodo_dsl.spec.model import KINDS, LEVELS
from dodo_dsl.spec.registry import KEYWORDS, SUFFIX

COMPOSE_FILES = ("docker-compose.yml", "docker-compose.yaml", "compose.yml", "compose.yaml")
PIPELINE = ".gitlab-ci.yml"
REGISTRY = "tests"
LEVEL, KIND = "sil", "closed-loop"
"""Of a test for which none is named."""
STARTS = {
    ("sil", "closed-loop"): "",
    ("sil", "open-loop"): "",
    ("sil", "perception"): "sil-perception",
    ("dil", "open-loop"): "dil-kiwi-track",
    ("dil", "perception"): "dil-static-rig",
    ("hil", "closed-loop"): "hil-dynamic",
    ("hil", "open-loop"): "hil-open-straight",
    ("hil", "perception"): "hil-camera",
}
"""What a new test of a level and a kind is a copy of; empty where a template is enough."""
_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
_LONGEST = 60
_FIRST = "sil-first"
_NO_APPLICATION = (
    f"write your application's compose file, and name it in {FILE_NAME}: application: {COMPOSE_FILES[0]}\n"
    "      (dodo new --application, in an empty folder, writes a first application and a test)"
)


_BUILDS = {
    "cpp": ("cmake -B build", "cmake --build build --parallel --target steering"),
    "ros": (f"PATH-OF-DODO'S-CHECKOUT/scripts/install-ros .ros  (or take ROS' own Python, in {FILE_NAME})",),
}
"""What is to be done before a program of a folder of templates can run."""

EXAMPLES = """examples:
  dodo new sil-my-curve                                a closed-loop simulation that compiles
  dodo new hil-my-curve --level hil                    the same on a rig, or emulated by dodo run --emulate
  dodo new sil-my-dark --extends sil-my-curve          a changed copy of another test
  dodo new dil-mine --level dil --rec drive.rec        your own recording, and its signal as the target
  dodo new sil-mine --extends sil-closed-kiwi-track    a copy of a shipped test and its files
  dodo new --map chicane --line 'straight 1 m, left 45 deg radius 1 m, right 45 deg radius 1 m, straight 1 m'
  dodo new --map hall --line points.csv --width '80 cm'  a map along points, x and y in m
  dodo new --application                               an application that drives, with a test that it passes
  dodo new --application --language cpp                the same in C++, on libcluon
  dodo new --application --ros                         a ROS 2 node in Python
  dodo new --deployment                                dodo.yml, application and GitLab pipeline in this folder
  dodo new --schemas                                   JSON schemas, by which editors complete dodo.yml and tests
"""


def add(parser: argparse.ArgumentParser) -> None:
    what = parser.add_mutually_exclusive_group()
    what.add_argument("name", nargs="?", metavar="NAME", help="name of the new test")
    what.add_argument("--map", metavar="NAME", help="write a map of a track, into the folder maps of your tests")
    what.add_argument(
        "--application", action="store_true", help="write a small application and a first test that it passes"
    )
    what.add_argument(
        "--deployment", action="store_true",
        help="write dodo.yml, a compose file and a GitLab pipeline into this folder, as far as it has none",
    )  # fmt: skip
    what.add_argument(
        "--schemas", action="store_true", help="write the JSON schemas of tests and of dodo.yml for editors"
    )
    of_test = parser.add_argument_group("of a test")
    of_test.add_argument("--level", choices=LEVELS, help="software, data or hardware in the loop (default: sil)")
    of_test.add_argument("--kind", choices=KINDS, help="default: closed-loop")
    of_test.add_argument("--extends", metavar="TEST", help="test that the new one extends; a shipped one is copied")
    of_test.add_argument("--rec", metavar="FILE.rec", type=Path,
                         help="recording that a new dil test plays, with its target")  # fmt: skip
    of_map = parser.add_argument_group("of a map")
    of_map.add_argument(
        "--line", metavar="LINE", help="its centre line, as below, or a CSV file of points, x and y in m"
    )
    of_map.add_argument("--width", metavar="W", help="width of the track (default: 50 cm)")
    of_map.add_argument("--lap", action="store_true", help="the line ends where it begins")
    of_application = parser.add_argument_group("of an application")
    of_application.add_argument("--language", choices=("python", "cpp"), help="default: python")
    of_application.add_argument("--ros", action="store_true", help="a ROS 2 node: pictures in, Twist out")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    is_test = not (options.map or options.application or options.deployment or options.schemas)
    for what, holds, names in (
        ("a test", is_test, ("level", "kind", "extends", "rec")),
        ("--map", bool(options.map), ("line", "width", "lap")),
        ("--application", options.application, ("language", "ros")),
    ):
        if given := [name for name in names if getattr(options, name) and not holds]:
            raise UsageError(f"--{given[0]} applies to {what}")
    if options.map:
        return _map(options, stdout)
    if options.application:
        return _application(options, stdout)
    if options.deployment:
        return _deployment(stdout)
    if options.schemas:
        return _schemas(stdout)
    return _test(options, stdout)


def _application(options: argparse.Namespace, stdout: TextIO) -> int:
    if options.ros and options.language:
        raise UsageError("--language applies to OpenDLV applications: the node of --ros is written in Python")
    root, has_ros = Path.cwd(), importlib.util.find_spec("rclpy") is not None
    if there := compose_file(root):
        raise UsageError(f"'{there}' exists already; nothing was written; name it in {FILE_NAME}: application: {there}")
    kind = "ros" if options.ros else options.language or "python"
    python = ".ros/bin/python" if kind == "ros" and not has_ros else "python"
    process = "build/steering" if kind == "cpp" else f"{python}, steering.py"
    compose = New(root / COMPOSE_FILES[0], filled(COMPOSE_FILES[0], process=process, ros=options.ros))
    files = {FILE_NAME: _dodo_yml(root, COMPOSE_FILES[0]), COMPOSE_FILES[0]: compose}
    files |= filled_folder(kind, root, base=f"dodo/vision:{__version__}", process=process)
    test = f"{REGISTRY}/{_FIRST}/{_FIRST}{SUFFIX}"
    text = filled(f"tests/{LEVEL}-{KIND}{SUFFIX}", name=_FIRST, pictures="", ros=options.ros)
    files[test] = New(root / test, text)
    if not (root / ".gitignore").exists():
        files[".gitignore"] = New(root / ".gitignore", filled("gitignore"))
    write_new([*files.values(), *world_files(text, root / REGISTRY)], stdout)
    program = next(name for name in files if name.startswith("steering."))
    builds = () if has_ros else _BUILDS.get(kind, ())
    say_next([*builds, f"dodo run {_FIRST}", f"edit {program} and the test"], stdout)
    return Exit.OK


def compose_file(root: Path) -> str:
    return next((name for name in COMPOSE_FILES if (root / name).is_file()), "")


def _dodo_yml(root: Path, application: str) -> New:
    without = existing_application.replaced(root / application) if compose_file(root) else {}
    return New(root / FILE_NAME, filled(FILE_NAME, application=application, without=without))


def _deployment(stdout: TextIO) -> int:
    """What there is stays; of a pipeline that is there, the lines are shown that it lacks."""
    root = Path.cwd()
    pipeline = filled("deployment/gitlab-ci.yml")
    own = compose_file(root)
    application = own or COMPOSE_FILES[0]
    templates = {name: package_data.templates() / name / "template.yml" for name in package_data.PIPELINES}
    files = [
        _dodo_yml(root, application),
        New(root / application, filled("deployment/docker-compose.yml")),
        New(root / PIPELINE, pipeline),
        *(New(root / f".gitlab/dodo/{name}.gitlab-ci.yml", path.read_bytes()) for name, path in templates.items()),
        New(root / ".gitignore", filled("gitignore")),
    ]
    kept = [file.path for file in files if file.path.exists()]
    write_new([file for file in files if file.path not in kept], stdout)
    stdout.writelines(f"kept: {shown_path(str(path))}\n" for path in kept)
    steps = [] if own else [f"name your services in {application}"]
    if root / PIPELINE in kept and b"dodo" not in (root / PIPELINE).read_bytes():
        lines = "".join(f"        {line}\n" for line in pipeline.decode().splitlines() if not line.startswith("#"))
        steps.append(f"add to {PIPELINE}:\n{lines}".rstrip())
    steps += [
        f"dodo new {_FIRST}",
        "dodo compile --check",
        "commit and push; GitLab runs the tests, on a runner with the tag sil",
    ]
    say_next(steps, stdout)
    return Exit.OK


def _schemas(stdout: TextIO) -> int:
    folder = Path.cwd() / SCHEMA_FOLDERS[0]
    write_new([New(folder / name, (package_data.schemas() / name).read_bytes()) for name in SCHEMAS], stdout)
    line = "# yaml-language-server: $schema="
    say_next(
        [
            f"write into the first line of {FILE_NAME}: {line}{SCHEMA_FOLDERS[0]}/{SCHEMAS[0]}",
            f"and of each test: {line}../../{SCHEMA_FOLDERS[0]}/{SCHEMAS[-1]}  (dodo new NAME does)",
        ],
        stdout,
    )
    return Exit.OK


def _map(options: argparse.Namespace, stdout: TextIO) -> int:
    from dodo_dsl.cli import new_map

    if not options.line:
        raise UsageError(
            f"--map needs --line, the centre line of the track: {new_map.EXPECTED}, or a CSV file of points"
        )
    _check_name(options.map, ())
    checked = load([])
    folder = _registry(checked) / "maps" / options.map
    with files_of_the_user():
        track = new_map.track(options.line, options.width or f"{new_map.LANE} m", options.lap)
    content = (new_map.as_json(new_map.track_map(track)) + "\n").encode()
    files = [
        New(file.path, content) if file.path.name == "map.json" else file for file in map_files("straight", folder)
    ]
    write_new(files, stdout)
    x, y, heading = (round(value, 4) + 0.0 for value in track.begin)
    stdout.write(f"{track.length:.2f} m to the finish; a test of the map has at its services\n")
    stdout.write(f"  map-path: ../maps/{options.map}\n")
    stdout.write(
        f"  x: {x:.4g} m, y: {y:.4g} m, yaw: {math.degrees(heading):.4g} deg        where the vehicle starts\n"
    )
    stdout.write("  goal: finish, walls: ['*']\n")
    return Exit.OK


def _test(options: argparse.Namespace, stdout: TextIO) -> int:
    if options.name is None:
        raise UsageError("name the new test: dodo new NAME; dodo new --help shows what it can be")
    _refuse_contradictions(options)
    shipped, checked = load([package_data.registry()]), load([])
    _check_name(options.name, [spec.location.stem for spec in checked.specs])
    root, registry = checked.deployment.root.resolve(), _registry(checked)
    files = []
    if checked.deployment.file is None:
        files = [_dodo_yml(root, compose_file(root))]
    made, note = _files(options, checked, shipped, registry, root)
    write_new([*files, *made], stdout)
    stdout.write(note)
    has_application = checked.deployment.application or (files and compose_file(root))
    emulate = " --emulate" if options.level == "hil" and not checked.deployment.rigs else ""
    todo = [] if has_application else [_NO_APPLICATION]
    say_next(
        [f"edit {shown_path(str(made[0].path))}", "dodo compile --check", *todo, f"dodo run {options.name}{emulate}"],
        stdout,
    )
    return Exit.OK


def _refuse_contradictions(options: argparse.Namespace) -> None:
    if options.extends and (options.level or options.kind or options.rec):
        raise UsageError("--level, --kind and --rec do not apply with --extends: they are those of the extended test")
    if options.rec and (options.level or "dil", options.kind or "open-loop") != ("dil", "open-loop"):
        raise UsageError("a recording is played at level dil, and begins an open-loop test")
    if not options.rec and (options.level or LEVEL, options.kind or KIND) not in STARTS:
        reason = "a dil test cannot be closed-loop: what was recorded does not react to the application"
        raise UsageError(f"{reason}; try: dodo new {options.name or 'NAME'} --level dil --kind open-loop")


def _check_name(name: str, taken: Sequence[str]) -> None:
    if not _NAME.fullmatch(name) or len(name) > _LONGEST:
        expected = "lower-case letters and digits in words joined by single hyphens, at most 60 characters"
        raise UsageError(f"'{name}' is not a valid name, expected {expected}")
    if name in KEYWORDS:
        raise UsageError(f"'{name}' is a keyword of GitLab's pipelines, expected a name for a job")
    if name in taken:
        raise UsageError(f"there is a test '{name}' already; names are unique over all registries")


def _registry(checked: Checked) -> Path:
    """The first registry of the repository's own; one that is not there yet counts if there is no other."""
    deployment, root = checked.deployment, checked.deployment.root.resolve()
    if deployment.file is None:
        return root / REGISTRY
    own = [d for d in checked.diagnostics if d.span.file == str(deployment.file) and d.severity == "error"]
    if wrong := [d for d in own if d.rule != "missing-file"]:
        raise UsageError(f"{FILE_NAME} has problems:\n{format_text(wrong)}")
    for registry in (*deployment.registry, *deployment.absent):
        if registry.resolve().is_relative_to(root) and not package_data.is_shipped(registry, root):
            return registry
    file = shown_path(str(deployment.file))
    raise UsageError(f'{file} names no folder for your own tests; add to it: registry: [{REGISTRY}, "dodo:"]')


def _files(
    options: argparse.Namespace, checked: Checked, shipped: Checked, registry: Path, root: Path
) -> tuple[list[New], str]:
    own = compose_file(root) if checked.deployment.file is None else ""
    application = checked.application or (as_written(root / own) if own else None)
    pictures = existing_application.pictures(application)
    if options.rec:
        from dodo_dsl.cli import recorded_drive  # slow to load, and rarely needed

        declared = [*application.declared.values()] if application else []
        sent = {name.partition("/")[0] for each in declared if each for name, _ in each.outputs}
        of_ros = any(each.topics for each in declared if each)
        return recorded_drive.files(options.name, options.rec, sent, registry, root, pictures, of_ros)
    level, kind = options.level or LEVEL, options.kind or KIND
    if base := options.extends or STARTS[level, kind]:
        return _from_another(options.name, base, checked, shipped, registry, root)
    lines = "".join(f"      {key}: {value}\n" for key, value in pictures.parameters("virtual-camera").items())
    text = filled(f"tests/{level}-{kind}{SUFFIX}", name=options.name, pictures=lines, ros=False)
    files = [*spec_files(options.name, registry / options.name, root, text), *world_files(text, registry)]
    return files, pictures.note


def _from_another(
    name: str, base_name: str, checked: Checked, shipped: Checked, registry: Path, root: Path
) -> tuple[list[New], str]:
    own = [spec for spec in checked.specs if not package_data.is_shipped(spec.location.root, root)]
    copied = [spec for spec in shipped.specs if package_data.is_shipped(spec.location.root, root)]
    base = next((spec for spec in (*own, *copied) if spec.name == base_name), None)
    if base is None:
        hint = did_you_mean(base_name, [spec.name for spec in (*own, *copied) if spec.name])
        raise UsageError(f"unknown test '{base_name}' to extend" + (f"; {hint}" if hint else ""))
    if base in copied:
        note = f"copied, because '{base_name}' ships with DoDo and a test extends only tests of its own registry\n"
        return copied_files(name, base, registry, root), note
    if not base.location.root.resolve().is_relative_to(root):
        raise UsageError(f"'{base_name}' is outside this repository; a test extends tests of its registry")
    return extending_files(name, base, root), ""
