"""``dodo images pull --for RIG``: the images that the tests of a rig need, before its first test needs them."""

import argparse
import os
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
    """Pulls what is missing or newer in its registry; raises UsageError if it is more than the rig's budget."""
    checked, rig = _tests(options)
    docker_command.require()
    engine = docker_command.ask("version", "--format", "{{.Server.Os}}/{{.Server.Arch}}")
    platform = f"linux/{rig.arch}" if rig.arch else engine
    if platform != engine:
        stdout.write(f"note: rig '{rig.name}' is {platform}, and this engine's machine {engine}\n")
    wanted, built = _images(checked, options.backend == "docker")
    for name in built:
        stdout.write(f"{printable(name)} has a 'build': the first test builds it\n")
    whole = 0
    for number, name in enumerate(wanted, 1):
        stdout.write(f"[{number}/{len(wanted)}] {printable(name)}\n")
        if not docker_command.show("pull", "--platform", platform, name):
            raise DockerError(f"{name} cannot be pulled; the output above says why")
        if (found := docker_command.platform(name)) != platform:
            raise DockerError(f"{name} is for {found}, not for {platform}")
        whole += docker_command.size(name)
    if rig.disk is not None and whole > rig.disk:
        text = f"the images of rig '{rig.name}' take up to {_megabytes(whole)}, and its 'disk' in dodo.yml is"
        raise UsageError(f"{text} {_megabytes(rig.disk)}; make them smaller, or the budget larger")
    stdout.write(f"the tests of rig '{rig.name}' need {len(wanted)} images of a registry, {_megabytes(whole)}\n")
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


def _images(checked: Checked, with_own: bool) -> tuple[list[str], list[str]]:
    """The images of a registry that the tests' containers need, and the names of services that are built."""
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
    return sorted(wanted), sorted(built)


def _megabytes(size: int) -> str:
    return f"{size / 1e6:,.1f} MB" if size < 10e6 else f"{size / 1e6:,.0f} MB"
