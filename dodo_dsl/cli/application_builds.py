"""``dodo images builds --push``: the application's images by ``docker buildx bake``, from checked builds.

No build sees the variables of this process, such as a pipeline's token.
"""

import argparse
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

from dodo_dsl import compiler
from dodo_dsl.application import hidden_paths
from dodo_dsl.application.construction import checked_builds
from dodo_dsl.application.interpolation import EnvironmentProblem
from dodo_dsl.application.model import ApplicationSource, image_variable
from dodo_dsl.application.read import read_application
from dodo_dsl.cli import selection
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.diagnostics import format_text, has_errors
from dodo_dsl.images.docker_command import DockerError
from dodo_dsl.run.docker.builds import HiddenContext, own_contexts
from dodo_dsl.run.hidden_paths import of_repository
from dodo_dsl.spec.deployment import Deployment


def add(parser: argparse.ArgumentParser) -> None:
    selection.add_application(parser)
    parser.add_argument(
        "--push", metavar="P", required=True,
        help="build and push each as P/SERVICE, from copies without tests, reports, compiled tests and .git; print "
        "lines DODO_IMAGE_<SERVICE>=IMAGE with digests"
    )  # fmt: skip
    parser.add_argument("--tag", metavar="T", default="latest", help="tag of the images (default: latest)")
    parser.add_argument("--platform", metavar="P,...", default="", help="platforms of the images")


def push(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
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
    with tempfile.TemporaryDirectory(prefix="dodo-builds-") as folder:
        hidden = _hidden(source, deployment, files)
        try:
            services = own_contexts(builds["services"], hidden, Path(folder).resolve(), Path.cwd())
        except (HiddenContext, OSError, shutil.Error) as error:
            raise UsageError(f"--push: {error}") from error
        stdout.writelines(f"{line}\n" for line in _bake({**builds, "services": services}, options, Path(folder)))
    return Exit.OK


_PASSED = ("PATH", "HOME", "DOCKER_CONFIG", "DOCKER_HOST", "DOCKER_TLS_VERIFY", "DOCKER_CERT_PATH", "BUILDX_BUILDER")
"""What the docker command needs of the environment."""


def _bake(builds: dict[str, Any], options: argparse.Namespace, folder: Path) -> list[str]:
    images = {name: f"{options.push}/{name}" for name in builds["services"]}
    if not images:
        return []
    services = {name: {**each, "image": f"{images[name]}:{options.tag}"} for name, each in builds["services"].items()}
    file, metadata = folder / "builds.yml", folder / "metadata.json"
    file.write_text(json.dumps({**builds, "services": services}))
    words = ["docker", "buildx", "bake", "--file", str(file), "--push", "--metadata-file", str(metadata)]
    words += ["--set", f"*.platform={options.platform}"] if options.platform else []
    environment = {name: os.environ[name] for name in _PASSED if name in os.environ}
    environment["BUILDX_BAKE_ENTITLEMENTS_FS"] = "0"  # the contexts are copies that are checked, in no working folder
    if subprocess.call(words, env=environment, stdout=subprocess.DEVNULL):
        raise DockerError("the application's images cannot be built and pushed; the output above says why")
    told = [each for each in json.loads(metadata.read_text()).values() if isinstance(each, dict)]
    digests = {each.get("image.name", ""): each.get("containerimage.digest") for each in told}
    if missing := [name for name in images if not digests.get(services[name]["image"])]:
        raise DockerError(f"the build of '{missing[0]}' has said no digest")
    return [
        f"{image_variable(name)}={image}@{digests[services[name]['image']]}" for name, image in sorted(images.items())
    ]


def _hidden(source: ApplicationSource, deployment: Deployment, files: Sequence[Path]) -> list[Path]:
    """What builds do not get; raises UsageError where tests among the application's own files cannot be compiled."""
    own = source.folder.resolve()
    roots = [own, *(root.resolve() for root in source.paths.roots)]
    found = [*hidden_paths.unseen(source, deployment), *of_repository(roots)]
    if any(own.is_relative_to(folder.resolve()) for folder in deployment.registry):
        checked = compiler.without_unsatisfied(compiler.load((), files))
        if not checked.ok or has_errors((made := compiler.plan(checked, own / "generated")).problems):
            raise UsageError("the tests beside the application cannot be compiled; dodo compile --check says why")
        found += [own / path for plan in made.compiled.suite.plans[:1] for path in plan.application.hidden]
    return found
