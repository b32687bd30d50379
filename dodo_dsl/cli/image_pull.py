"""``dodo images pull --for RIG``: the images that the tests of a rig need, before its first test needs them."""

import argparse
import os
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from dodo_dsl import compiler
from dodo_dsl.application import secret_variables
from dodo_dsl.cli import selection
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.compiler import Checked
from dodo_dsl.diagnostics import did_you_mean, has_errors
from dodo_dsl.images import docker_command
from dodo_dsl.images.docker_command import DockerError
from dodo_dsl.images.remote import UNPACKED, layers
from dodo_dsl.run.docker import pulls
from dodo_dsl.run.docker.compose import with_images
from dodo_dsl.spec.rig import Rig
from dodo_dsl.terminal import printable


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--for", dest="rig", required=True, metavar="RIG", help="the rig of dodo.yml whose tests run here"
    )
    parser.add_argument(
        "--backend", choices=("mixed", "docker"), default="mixed",
        help="docker: also the images of DoDo's services (default: mixed, which needs the application's alone)"
    )  # fmt: skip
    selection.add_application(parser)


def pull(options: argparse.Namespace, stdout: TextIO) -> int:
    """Pulls what is missing or newer in its registry; raises UsageError if there is no room for it."""
    checked, rig = _tests(options)
    docker_command.require()
    engine = docker_command.ask("version", "--format", "{{.Server.Os}}/{{.Server.Arch}}")
    platform = f"linux/{rig.arch}" if rig.arch else engine
    if platform != engine:
        stdout.write(f"note: rig '{rig.name}' is {platform}, and this engine's machine {engine}\n")
    wanted, built, hints = _images(checked, options.backend == "docker")
    for name in built:
        stdout.write(f"{printable(name)} has a 'build': the first test builds it\n")
    if not wanted:
        stdout.write(f"the tests of rig '{rig.name}' need no images of a registry\n")
        return Exit.OK
    stdout.write(_room(rig, {name: _layers(name, platform, hints.get(name, "")) for name in wanted}))
    for number, name in enumerate(wanted, 1):
        stdout.write(f"[{number}/{len(wanted)}] {printable(name)}\n")
        if not docker_command.show("pull", "--platform", platform, name):
            raise DockerError(f"{name} cannot be pulled; the output above says why")
    for name in wanted:
        size, found = docker_command.size(name), docker_command.platform(name)
        if found != platform:
            raise DockerError(f"{name} is for {found}, not for {platform}")
        stdout.write(f"{printable(name)}  {found}  {_megabytes(size)}\n")
    return Exit.OK


def _tests(options: argparse.Namespace) -> tuple[Checked, Rig]:
    """The tests of the rig, and of its pools; raises UsageError."""
    rigs = selection.checked_deployment().rigs
    if options.rig not in rigs:
        hint = did_you_mean(options.rig, rigs)
        raise UsageError(f"unknown rig '{options.rig}' in dodo.yml" + (f"; {hint}" if hint else ""))
    checked = selection.select([], (), options.application)
    tests = tuple(test for test in checked.tests if test.spec.rig == options.rig)
    if not tests:
        unread = "" if checked.ok else " of those without problems; dodo compile --check shows the others"
        raise UsageError(f"no test runs on rig '{options.rig}'{unread}")
    if checked.application and not {test.spec.path for test in tests} <= {s.path for s in checked.sound().specs}:
        raise UsageError(f"tests of rig '{options.rig}' have problems; dodo compile --check shows them")
    return replace(checked, tests=tests), rigs[options.rig]


def _layers(name: str, platform: str, hint: str) -> Mapping[str, int]:
    """The layers of an image of a registry; raises DockerError with the ``hint`` if it has none."""
    try:
        return layers(name, platform)
    except DockerError as error:
        raise DockerError(f"{error}; {hint}" if hint else str(error)) from None


def _images(checked: Checked, with_own: bool) -> tuple[list[str], list[str], dict[str, str]]:
    """The images of a registry that the tests' containers need, the names of services that are built, and hints.

    The hints say how to get images of DoDo's.
    """
    hints: dict[str, str] = {}
    wanted: set[str] = set()
    built: set[str] = set()
    made = compiler.plan(checked, Path("generated").absolute())
    if has_errors(made.problems):
        raise UsageError("the tests cannot be compiled; dodo compile --check says why")
    for plan in made.compiled.suite.plans:
        variables = secret_variables.allowed(os.environ, plan.application.access.passed)
        services = with_images(plan.application, variables)
        built |= {name for name, service in services.items() if "build" in service}
        wanted |= {service["image"] for service in services.values() if "build" not in service}
        wanted |= {service.image for service in plan.services} if with_own else set()
        hints |= pulls.image_hints(plan)
    return sorted(wanted), sorted(built), hints


def _room(rig: Rig, images: Mapping[str, Mapping[str, int]]) -> str:
    """How much room the images need and find; raises UsageError if they find too little.

    Those that the engine has count for the rig's budget alone.
    """
    sizes = {digest: size for image in images.values() for digest, size in image.items()}
    there = {digest for name, image in images.items() if docker_command.is_local(name) for digest in image}
    all_of_them, packed = UNPACKED * sum(sizes.values()), sum(sizes[digest] for digest in sizes.keys() - there)
    if rig.disk is not None and all_of_them > rig.disk:
        text = f"the images of rig '{rig.name}' take about {_megabytes(all_of_them)}, and its 'disk' in dodo.yml is"
        raise UsageError(f"{text} {_megabytes(rig.disk)}; make them smaller, or the budget larger")
    need = UNPACKED * packed
    folder = Path(docker_command.ask("info", "--format", "{{.DockerRootDir}}"))
    free = shutil.disk_usage(folder).free if folder.is_dir() else None
    if free is not None and need > free:
        raise UsageError(
            f"the images need about {_megabytes(need)} more, and {folder} has {_megabytes(free)} left; "
            "'docker image prune' removes images that have no name"
        )
    budget = f", budget {_megabytes(rig.disk)}" if rig.disk is not None else ""
    left = f", free {_megabytes(free)}" if free is not None else ""
    return f"to fetch {_megabytes(packed)}, room about {_megabytes(need)} of {_megabytes(all_of_them)}{budget}{left}\n"


def _megabytes(size: int) -> str:
    return f"{size / 1e6:,.1f} MB" if size < 10e6 else f"{size / 1e6:,.0f} MB"
