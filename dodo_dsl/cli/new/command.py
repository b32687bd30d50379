"""dodo new: write a new test, or what a repository with tests needs."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

from dodo_dsl import package_data
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.exits import Exit
from dodo_dsl.cli.new import scaffold
from dodo_dsl.cli.new.scaffold import New
from dodo_dsl.cli.new.shipped_copy import copied_files
from dodo_dsl.compiler import Checked, load
from dodo_dsl.diagnostics import shown_path
from dodo_dsl.spec.deployment.deployment import FILE_NAME, Deployment
from dodo_dsl.spec.model import KINDS, LEVELS

EXAMPLES = """examples:
  dodo new sil-my-curve                                a closed-loop simulation that compiles
  dodo new hil-my-curve --level hil                    the same on a rig, at first the emulated one
  dodo new sil-my-dark --extends sil-my-curve          a changed copy of another test
  dodo new sil-mine --extends sil-closed-kiwi-track    a copy of a shipped test and its files
  dodo new --deployment                                dodo.yml, application and pipeline in this folder
"""


def add(parser: argparse.ArgumentParser) -> None:
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("name", nargs="?", metavar="NAME", help="name of the new test")
    what.add_argument(
        "--deployment", action="store_true", help="write what a repository with tests needs into this folder"
    )
    parser.add_argument("--level", choices=LEVELS, help="level of the new test (default: sil)")
    parser.add_argument("--kind", choices=KINDS, help="kind of the new test (default: closed-loop)")
    parser.add_argument("--extends", metavar="TEST", help="test that the new one changes; a shipped one is copied")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    return _deployment(options, stdout) if options.deployment else _test(options, stdout)


def _test(options: argparse.Namespace, stdout: TextIO) -> int:
    checked = load([])
    specs = list(checked.specs)
    scaffold.check_name(options.name, [spec.location.stem for spec in specs])
    root = checked.deployment.root.resolve()
    note = ""
    if options.extends:
        if options.level or options.kind:
            raise UsageError("--level and --kind do not apply with --extends: they are those of the extended test")
        files, note = _from_another(options, checked, root)
    else:
        level, kind = options.level or "sil", options.kind or "closed-loop"
        files = scaffold.test_files(options.name, level, kind, _registry(checked.deployment), root)
    there = [file.path for file in files if file.path.exists()]
    if there:
        raise UsageError(f"'{shown_path(str(there[0]))}' exists already; nothing was written")
    _write(files, stdout)
    stdout.write(note)
    spec = shown_path(str(files[0].path))
    _next([f"make {spec} yours", "dodo compile --check", f"dodo run {options.name}"], stdout)
    return Exit.OK


def _from_another(options: argparse.Namespace, checked: Checked, root: Path) -> tuple[list[New], str]:
    """A test that extends one of the repository, or a copy of one that ships with DoDo; with a note for the user."""
    own = [spec for spec in checked.specs if not package_data.is_shipped(spec.location.root, root)]
    shipped = load([package_data.registry()])
    others = [spec for spec in shipped.specs if package_data.is_shipped(spec.location.root, root)]
    base = scaffold.base_test(options.extends, [*own, *others])
    if not package_data.is_shipped(base.location.root, root):
        if not base.location.root.resolve().is_relative_to(root):
            raise UsageError(f"'{options.extends}' is outside this repository; a test extends tests of its registry")
        return scaffold.extending_files(options.name, base, root), ""
    instances = [spec for spec in others if spec.path == base.path]
    files = copied_files(options.name, instances, shipped.manifests, _registry(checked.deployment), root)
    return (
        files,
        f"copied, because '{options.extends}' ships with DoDo and a test extends only tests of its own registry\n",
    )


def _registry(deployment: Deployment) -> Path:
    """The first registry that belongs to the repository itself, and not to a DoDo that is installed in it."""
    if deployment.file is None:
        raise UsageError(f"there is no {FILE_NAME} in this folder or above; dodo new --deployment writes one")
    root = deployment.root.resolve()
    for registry in deployment.registry:
        if registry.resolve().is_relative_to(root) and not package_data.is_shipped(registry, root):
            return registry
    raise UsageError(f"{shown_path(str(deployment.file))} has no folder of this repository in 'registry'")


def _deployment(options: argparse.Namespace, stdout: TextIO) -> int:
    if options.level or options.kind or options.extends:
        raise UsageError("--level, --kind and --extends apply to a test, not to --deployment")
    files = scaffold.deployment_files(Path.cwd())
    there = [file for file in files if file.path.exists()]
    _write([file for file in files if file not in there], stdout)
    for file in there:
        stdout.write(f"kept: {shown_path(str(file.path))}\n")
    if len(there) == len(files):
        stdout.write("\nnothing to write\n")
        return Exit.OK
    steps = [f"name your services in {next(f.path.name for f in files if f.path.name in scaffold.COMPOSE_FILES)}"]
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
