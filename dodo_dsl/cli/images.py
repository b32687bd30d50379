"""dodo images: build, push and pull images, and list what they are made of.

A deployment's own services have images, too.
"""

import argparse
import json
import shlex
import shutil
import tempfile
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

from dodo_dsl import atomic, compiler, package_data
from dodo_dsl.application import unseen
from dodo_dsl.application.construction import checked_builds
from dodo_dsl.application.interpolation import EnvironmentProblem
from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.application.read import read_application
from dodo_dsl.cli import image_pull, selection
from dodo_dsl.cli.errors import Exit, UsageError, require_extra
from dodo_dsl.diagnostics import format_text, has_errors, shown_path
from dodo_dsl.images import build_context, docker_command, sbom
from dodo_dsl.images import names as images_names
from dodo_dsl.images.names import DODO, PLATFORM, Image, choose, known, of_platforms, tagged
from dodo_dsl.run.docker.builds import HiddenContext, own_contexts
from dodo_dsl.run.hidden_paths import of_repository
from dodo_dsl.spec.deployment import Deployment, build_command
from dodo_dsl.spec.manifest import load_manifests

Dockerfiles = Mapping[str, Path | None]


def dockerfiles(deployment: Deployment) -> Dockerfiles:
    """The Dockerfile of each own image, None if there is none; raises UsageError for manifests with problems."""
    if not deployment.services:
        return {}
    manifests, problems = load_manifests(deployment.services)
    if has_errors(problems):
        files = sorted({shown_path(d.span.file) for d in problems if d.severity == "error"})
        raise UsageError(f"problems in {', '.join(files)}; dodo compile --check shows them")
    own = [m for m in manifests.values() if m.folder.parent != package_data.services()]
    return images_names.dockerfiles(own, known(load_manifests()[0].values()))


def require_dockerfiles(names: Collection[str], own: Dockerfiles, images: Sequence[Image]) -> None:
    """Raises UsageError if an image is named that has no Dockerfile."""
    for image in images:
        if image.name in names and own.get(image.name, Path()) is None:
            base = images_names.beside(image.reference, "base")
            raise UsageError(
                f"there is no Dockerfile next to the service.yml of '{image.name}': write one there, or build "
                f"{image.reference} from your own Dockerfile on {base}"
            )


def build_own(image: Image, dockerfile: Path, stdout: TextIO) -> None:
    """Builds an image; raises UsageError if the one below it is missing, and DockerError."""
    base = images_names.base_of(image, dockerfile)
    if base.startswith(f"{Deployment.image_prefix}/") and not docker_command.is_local(base):
        prefix, _, last = base.rpartition("/")
        name, _, tag = last.partition(":")
        raise UsageError(f"{base} is not on this machine; build it first: {build_command(prefix, tag, name)}")
    code, _ = docker_command.show(images_names.build_words(image, dockerfile), stdout)
    if code:
        file = shown_path(str(dockerfile))
        raise docker_command.DockerError(f"{file} cannot be built on {base}; the output above says why")
    say_built([image], stdout)


def say_built(images: Sequence[Image], stdout: TextIO) -> None:
    width = max(len(image.reference) for image in images)
    for image in images:
        stdout.write(f"built {image.reference:<{width}}  {docker_command.size(image.reference) / 1e6:.0f} MB\n")


EXAMPLES = """examples:
  dodo images build                                   all images, named as in dodo.yml
  dodo images build collision virtual-camera          two images
  dodo images build smoothness                        that of your own service, from the Dockerfile next to its manifest
  dodo images build dodo                              DoDo itself with all that it runs, for jobs of a pipeline
  dodo images build --offline-wheels                  if a build cannot reach the package index
  dodo images build --platform linux/arm64            for a Raspberry Pi, on another machine with QEMU
  dodo images push --prefix registry.example.org/dodo
  dodo images push --platform linux/amd64,linux/arm64 --prefix registry.example.org/dodo
  dodo images pull --for kiwi-dynamic                 on the rig's computer, before its first test
  dodo images builds --contexts /tmp/c > builds.yml  the application's own, checked, for docker buildx bake
  dodo images sbom --output build/sbom                a bill of materials of each image, and of this Python
"""
_INDEX_HINT = "if a build cannot reach the package index, --offline-wheels downloads the packages on this machine"


def add(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    build = _action(actions, "build", "build images from the installed DoDo")
    build.add_argument("--base-image", metavar="I", help="base image with Python (default: a python:*-slim)")
    build.add_argument(
        "--docker-image", metavar="I",
        help="image that 'dodo' has the docker command and its plugins from (default: a docker:*-cli)"
    )  # fmt: skip
    build.add_argument(
        "--offline-wheels", action="store_true", help="download packages on this machine, not in the build"
    )
    build.add_argument("--source", metavar="URL", default="", help="URL of the sources, for the images' labels")
    _action(actions, "push", "push images to their registry; log in with 'docker login' first")
    text = "pull the images that the tests of a rig need, if there is room for them"
    image_pull.add(actions.add_parser("pull", help=text, description=text))
    text = "check the application's builds, and write them as a compose file for 'docker buildx bake'"
    builds = actions.add_parser("builds", help=text, description=text)
    selection.add_application(builds)
    builds.add_argument(
        "--contexts", type=Path, metavar="DIR",
        help="build from copies in this folder, without tests, reports, compiled tests and .git: keep it until the "
        "images are built (default: the folders themselves)"
    )  # fmt: skip
    sbom = _action(actions, "sbom", "write what built images, and the Python that runs DoDo, are made of (CycloneDX)")
    sbom.add_argument("--no-images", action="store_true", help="only the Python that runs DoDo; needs no Docker engine")
    sbom.add_argument("-o", "--output", metavar="DIR", default="build/sbom", help="folder (default: build/sbom)")


def _action(
    actions: "argparse._SubParsersAction[argparse.ArgumentParser]", name: str, text: str
) -> argparse.ArgumentParser:
    action = actions.add_parser(name, help=text, description=text)
    action.add_argument(
        "--platform", type=_platforms, default=[], metavar="P,...",
        help="machines that the images are for, such as linux/arm64 (default: the engine's); several of them have the "
        "tags T-amd64 and T-arm64, and 'push' makes T a list of these"
    )  # fmt: skip
    action.add_argument(
        "name",
        nargs="*",
        metavar="NAME",
        help="services, sandbox, base, geometry, vision or dodo (default: all but dodo)",
    )
    action.add_argument(
        "--prefix", metavar="P", help="prefix of the images' names (default: images.prefix of dodo.yml, or dodo)"
    )
    action.add_argument(
        "--tag", metavar="T", help="tag of the images (default: images.tag of dodo.yml, or the version)"
    )
    return action


def _platforms(text: str) -> list[str]:
    found = list(dict.fromkeys(text.split(",")))
    for one in found:
        if not PLATFORM.fullmatch(one):
            raise argparse.ArgumentTypeError(f"unknown platform '{one}'; write platforms as linux/amd64,linux/arm64")
    return found


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    if options.action == "pull":
        return image_pull.pull(options, stdout)
    if options.action == "builds":
        return _show_builds(options, stdout, stderr)
    deployment = selection.checked_deployment()
    images = _chosen(options, deployment)
    if options.action == "sbom" and options.no_images:
        images = []
    else:
        docker_command.require_engine()
    if options.action == "sbom":
        return _sbom(options, images, stdout)
    if options.action == "push":
        return _push(options, images, stdout)
    docker_command.require_buildx()
    own = dockerfiles(deployment)
    require_dockerfiles(options.name, own, images)
    for platform in options.platform or [""]:
        wanted = [one for one in of_platforms(images, options.platform) if one.platform == platform]
        if stages := [image for image in wanted if image.name not in own]:
            _build(options, stages, stdout)
        for image in wanted:
            if dockerfile := own.get(image.name):
                build_own(image, dockerfile, stdout)
    return Exit.OK


def _show_builds(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    """Writes the application's checked builds as a compose file; raises UsageError if there is no application."""
    deployment = selection.checked_deployment()
    files = selection.existing_files(options.application) or deployment.application
    if not files:
        raise compiler.NoApplication
    source, problems = read_application(
        files, compiler.access(deployment), deployment.sandbox, declarations=deployment.declarations
    )
    stderr.write(format_text(problems))
    if source is None or has_errors(problems):
        return Exit.PROBLEMS
    try:
        builds = checked_builds(source)
    except EnvironmentProblem as error:
        raise UsageError(f"the application's builds: {error}") from error
    if options.contexts:
        builds = _own_contexts(builds, _hidden(source, deployment, files), options.contexts)
    stdout.write(json.dumps(builds, indent=2) + "\n")
    return Exit.OK


def _own_contexts(builds: dict[str, Any], hidden: Sequence[Path], folder: Path) -> dict[str, Any]:
    """The same builds with their own contexts in a folder; raises UsageError if it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        own = Path(tempfile.mkdtemp(dir=folder))
        return {**builds, "services": own_contexts(builds["services"], hidden, own.resolve(), Path.cwd())}
    except (HiddenContext, OSError, shutil.Error) as error:
        raise UsageError(f"--contexts: {error}") from error


def _hidden(source: ApplicationSource, deployment: Deployment, files: Sequence[Path]) -> list[Path]:
    """What builds do not get; raises UsageError where tests among the application's own files cannot be compiled."""
    own = source.folder.resolve()
    roots = [own, *(root.resolve() for root in source.paths.roots)]
    found = [*unseen.unseen_folders(source, deployment), *of_repository(roots)]
    if any(own.is_relative_to(folder.resolve()) for folder in deployment.registry):
        checked = compiler.without_unsatisfied(compiler.load((), files))
        if not checked.ok or has_errors((made := compiler.plan(checked, own / "generated")).problems):
            raise UsageError("the tests beside the application cannot be compiled; dodo compile --check says why")
        found += [own / path for plan in made.compiled.suite.plans[:1] for path in plan.application.hidden]
    return found


def _chosen(options: argparse.Namespace, deployment: Deployment) -> list[Image]:
    prefix = (options.prefix or deployment.image_prefix).rstrip("/")
    if options.action == "push" and prefix == Deployment.image_prefix:
        raise UsageError("no registry; name it with --prefix or as images.prefix in dodo.yml")
    names = known(load_manifests()[0].values())
    own = dockerfiles(deployment)
    found = choose(options.name, (*names, *own), prefix, options.tag or deployment.image_tag)
    if options.name:
        return found
    is_left = options.action == "sbom"  # it may not know what somebody else's image is made of
    return [image for image in found if image.name not in own or (own[image.name] and not is_left)]


def _build(options: argparse.Namespace, images: list[Image], stdout: TextIO) -> None:
    """Builds images of one platform, one of them alone at first, so that what all have in common is one layer."""
    packages = None
    whole = any(image.name == DODO for image in images)
    if options.offline_wheels:
        base = options.base_image or build_context.default_base_image()
        packages = _packages(base, images[0].platform, whole, stdout)
    with tempfile.TemporaryDirectory(prefix="dodo-images-") as name:
        folder = Path(name) / "dodo-images"
        folder.mkdir()
        build_context.assemble(folder, packages, whole=whole)
        build_context.define(folder, images, options.source, options.base_image, options.docker_image)
        progress = "auto" if stdout.isatty() else "plain"
        words = ("buildx", "bake", "--file", build_context.DEFINITION, "--progress", progress)
        code, output = docker_command.show((*words, images[0].name), stdout, folder)
        if not code and len(images) > 1:
            code, output = docker_command.show(words, stdout, folder)
    if code:
        hint = f"; {_INDEX_HINT}" if packages is None and (stdout.isatty() or "requirements/install" in output) else ""
        raise docker_command.DockerError(f"the images cannot be built; the output above says why{hint}")
    say_built(images, stdout)


def _packages(base_image: str, platform: str, whole: bool, stdout: TextIO) -> Path:
    python = build_context.python_of(base_image, platform)
    stdout.write(f"downloading packages for Python {python.tag} on {python.machine} with pip\n")
    stdout.flush()
    return build_context.provide_wheels(python, build_context.cache_folder(), whole=whole)


def _require_built(options: argparse.Namespace, images: list[Image]) -> None:
    missing = [image for image in images if not docker_command.is_local(image.reference)]
    if missing:
        platforms = ",".join(dict.fromkeys(image.platform for image in images if image.platform))
        words = [*(["--platform", platforms] if platforms else []), *dict.fromkeys(image.name for image in missing)]
        for flag, value in (("--prefix", options.prefix), ("--tag", options.tag)):
            words += [flag, value] if value else []
        command = shlex.join(["dodo", "images", "build", *words])
        raise UsageError(f"{missing[0].reference} is not on this machine; build it first: {command}")
    for image in images:
        if image.platform and (found := docker_command.platform(image.reference)) != image.platform:
            raise UsageError(f"{image.reference} is for {found}, not for {image.platform}")


def _sbom(options: argparse.Namespace, images: list[Image], stdout: TextIO) -> int:
    require_extra("this", "sbom")
    folder = Path(options.output)
    _require_built(options, images)
    folder.mkdir(parents=True, exist_ok=True)
    bills = {"python": sbom.of_environment(), **{i.name: sbom.of_image(i.name, i.reference) for i in images}}
    for name, text in bills.items():
        atomic.write_text(folder / f"{name}.cdx.json", text)
        stdout.write(f"wrote {folder / name}.cdx.json\n")
    return Exit.OK


def _push(options: argparse.Namespace, images: list[Image], stdout: TextIO) -> int:
    platforms = options.platform
    pushed = of_platforms(images, platforms)
    _require_built(options, pushed)
    for number, image in enumerate(pushed, 1):
        stdout.write(f"[{number}/{len(pushed)}] {image.reference}\n")
        _send(("push", image.reference), image.reference, stdout)
    if len(platforms) > 1:
        docker_command.require_buildx()
        for image in images:
            stdout.write(f"{image.reference}: a list of {', '.join(platforms)}\n")
            parts = [tagged(image, platform) for platform in platforms]
            _send(("buildx", "imagetools", "create", "--tag", image.reference, *parts), image.reference, stdout)
    return Exit.OK


def _send(words: tuple[str, ...], reference: str, stdout: TextIO) -> None:
    code, output = docker_command.show(words, stdout)
    if code:
        denied = any(word in output for word in ("denied", "unauthorized", "no basic auth"))
        hint = f"; log in with: docker login {reference.partition('/')[0]}" if denied else ""
        raise docker_command.DockerError(f"{reference} cannot be pushed; the output above says why{hint}")
