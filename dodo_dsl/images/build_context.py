"""The build context: what ``services/Dockerfile`` copies, and wheels for a build without a package index.

Sources come from a checkout or from an installed wheel. pip downloads wheels here, for the base image's Python.
"""

import contextlib
import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import __version__, atomic, package_data
from dodo_dsl.images import docker_command
from dodo_dsl.images.names import Image

DEFINITION = "docker-bake.json"
LOCK = "locks/base.txt"
"""Versions of all packages, with the hashes of their wheels."""
REQUIREMENTS = "services/requirements"
_DOCKERFILE = "services/Dockerfile"
_DATA = ("schemas", "templates", "tests_registry")
"""What DoDo has beside its package and the services."""
_FIRMWARE, _RIG = "build/firmware", ("rig-emulator", "gantry.elf", "gantry-circle.elf")
"""The emulated rig, if ``make firmware`` has built it: part of the gantry's image."""
_TIME, _OF_TIME = "build/time", ("dodo-time", "libdodo-time.so")
"""What gives an application the test's time, if ``scripts/setup`` has built it: part of the sandbox's image."""


def assemble(folder: Path, wheels: Path | None, *, whole: bool = False) -> None:
    """Copies sources, versions and wheels into an empty folder, with their dates.

    The sources are those of services, or the ``whole`` of DoDo with its data.

    The engine identifies a context by its folder's name and transfers only files whose date has changed.
    """
    root, package = package_data.root(), Path(package_data.__file__).parent
    no_bytecode = shutil.ignore_patterns("__pycache__")
    (folder / LOCK).parent.mkdir()
    shutil.copy2(root / LOCK, folder / LOCK)
    shutil.copytree(root / "services", folder / "services", ignore=no_bytecode)
    if whole:
        for name in _DATA:
            shutil.copytree(root / name, folder / name, ignore=no_bytecode)
        shutil.copytree(package, folder / "dodo_dsl", ignore=shutil.ignore_patterns("__pycache__", "_data"))
    else:
        shutil.copytree(package / "opendlv", folder / "dodo_dsl" / "opendlv", ignore=no_bytecode)
        shutil.copy2(package / "__init__.py", folder / "dodo_dsl" / "__init__.py")
    if all((root / _FIRMWARE / name).is_file() for name in _RIG):
        (folder / "rig").mkdir()
        for name in _RIG:
            shutil.copy2(root / _FIRMWARE / name, folder / "rig" / name)
    if all((root / _TIME / name).is_file() for name in _OF_TIME):
        shutil.copytree(root / _TIME, folder / "time")
    if wheels is not None:
        shutil.copytree(wheels, folder / "wheels", copy_function=_link)


def _link(source: str, target: str) -> None:
    """Hard-links a wheel, or copies it if that is impossible."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def define(
    folder: Path, images: Sequence[Image], source: str, base_image: str | None = None, docker_image: str | None = None
) -> None:
    """Writes the targets of ``docker buildx bake``, one per image; the default images are the Dockerfile's."""
    named = {"BASE_IMAGE": base_image, "DOCKER_IMAGE": docker_image}
    arguments = {"VERSION": __version__, "SOURCE": source} | {name: value for name, value in named.items() if value}
    targets = {
        image.name: {
            "context": ".",
            "dockerfile": _DOCKERFILE,
            "target": image.name,
            "args": arguments,
            "tags": [image.reference],
            "output": ["type=docker"],
            **({"platforms": [image.platform]} if image.platform else {}),
        }
        for image in images
    }
    definition = {"group": {"default": {"targets": list(targets)}}, "target": targets}
    (folder / DEFINITION).write_text(json.dumps(definition, indent=2), encoding="utf-8")


def default_base_image() -> str:
    """The Dockerfile's own base image."""
    for line in (package_data.root() / _DOCKERFILE).read_text(encoding="utf-8").splitlines():
        if line.startswith("ARG BASE_IMAGE="):
            return line.partition("=")[2].strip()
    raise ValueError(f"{_DOCKERFILE} names no BASE_IMAGE")


_OLDEST_GLIBC = 17  # manylinux2014 is glibc 2.17
_QUESTION = "import platform, sys; print(*sys.version_info[:2], platform.machine(), platform.libc_ver()[1] or '-')"


class WheelsError(Exception):
    """Wheels that cannot be provided; one sentence."""


@dataclass(frozen=True)
class Python:
    """The Python of a base image: (major, minor), the machine such as ``aarch64``, and glibc's (major, minor)."""

    version: tuple[int, int]
    machine: str
    glibc: tuple[int, int]

    @property
    def tag(self) -> str:
        return f"{self.version[0]}.{self.version[1]}"

    def platforms(self) -> list[str]:
        """Compatible wheel platforms, the newest first (PEP 600)."""
        newest = max(self.glibc[1], _OLDEST_GLIBC)
        names = [f"manylinux_2_{minor}_{self.machine}" for minor in range(newest, _OLDEST_GLIBC - 1, -1)]
        return [*names, f"manylinux2014_{self.machine}"]


def python_of(image: str, platform: str = "") -> Python:
    """Asks an image, of a platform; the engine pulls it when it is missing. Raises WheelsError."""
    words = ("--platform", platform) if platform else ()
    try:
        answer = docker_command.ask(
            "run", "--rm", *words, "--network", "none", "--entrypoint", "python3", image, "-c", _QUESTION
        )
        major, minor, machine, glibc = answer.split()
        glibc_major, glibc_minor = glibc.split(".")[:2]
        return Python((int(major), int(minor)), machine, (int(glibc_major), int(glibc_minor)))
    except docker_command.DockerError as error:
        foreign = f" for {platform}, which this machine may not run without QEMU" if platform else ""
        raise WheelsError(f"base image {image} does not run python3{foreign}: {error}") from None
    except ValueError:
        raise WheelsError(f"base image {image} has no Python with glibc, which the wheels need") from None


def cache_folder() -> Path:
    """Where downloaded wheels are kept from build to build."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "dodo" / "wheels"


def provide_wheels(python: Python, cache: Path, *, whole: bool = False) -> Path:
    """A folder with a wheel for each requirement and nothing else, all with locked hashes; raises WheelsError.

    It is named after its requirements, and appears only when it is complete. The requirements are those of services,
    or the ``whole`` of the lock.
    """
    if whole:
        locked = [(package_data.root() / LOCK).read_text(encoding="utf-8")]
    else:
        locked = [_locked(file) for file in sorted((package_data.root() / REQUIREMENTS).glob("*.txt"))]
    digest = hashlib.sha256(repr(python).encode())
    for text in locked:
        digest.update(text.encode())
    folder = cache / digest.hexdigest()[:16]
    if not folder.is_dir():
        with contextlib.suppress(FileExistsError), atomic.new_folder(folder) as part:  # another build may be faster
            _download(python, "".join(locked), part)
    return folder


def _locked(requirements: Path) -> str:
    """The versions and hashes of a file of names, as the image build has them, too; raises WheelsError."""
    root = package_data.root()
    words = ["sh", str(root / REQUIREMENTS / "locked"), str(requirements), str(root / LOCK)]
    result = subprocess.run(words, capture_output=True, text=True, check=False)
    if result.returncode:
        raise WheelsError(f"{requirements.name}: {result.stderr.strip()}; run .venv/bin/python scripts/lock")
    return result.stdout


def _download(python: Python, locked: str, folder: Path) -> None:
    words = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "download"]
    words += ["--dest", str(folder), "--only-binary", ":all:", "--implementation", "cp", "--no-deps"]
    words += ["--python-version", python.tag, "--require-hashes", "--requirement", "/dev/stdin"]
    words += [word for platform in python.platforms() for word in ("--platform", platform)]
    result = subprocess.run(words, input=locked, capture_output=True, text=True, errors="replace", check=False)
    if result.returncode:
        said = [line.strip() for line in result.stderr.splitlines() if line.strip()]
        why = next((line for line in reversed(said) if line.startswith("ERROR")), said[-1] if said else "")
        raise WheelsError(f"pip cannot download wheels for Python {python.tag} on {python.machine}: {why}")
