"""The build context: what ``services/Dockerfile`` copies, and wheels for a build without a package index.

Sources come from a checkout or from an installed wheel. pip downloads wheels here, for the base image's Python.
"""

import contextlib
import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import atomic, package_data
from dodo_dsl.images import docker_command

BAKE = "services/docker-bake.hcl"
LOCK = "locks/base.txt"
"""Versions of all packages, with the hashes of their wheels."""
_EXTRAS, _OF_ROS, _LOCKED = "locks/extras.txt", "services/requirements/ros.txt", "services/requirements/locked"
_DOCKERFILE = "services/Dockerfile"
_PARTS = ("build/firmware", "build/time", "locks", "schemas", "services", "templates", "tests_registry")
"""What a checkout has beside the package. The emulated rig, and what gives the test's time, may not be built."""


def assemble(folder: Path, wheels: Sequence[Path] = ()) -> None:
    """Copies what the images are made of into an empty folder, as a checkout has it, and with its dates.

    The engine identifies a context by its folder's name and transfers only files whose date has changed.
    """
    parts = {name: package_data.root() / name for name in _PARTS}
    parts["dodo_dsl"] = Path(package_data.__file__).parent
    for name, source in parts.items():
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__", "_data"))
    for source in wheels:
        shutil.copytree(source, folder / "wheels", dirs_exist_ok=True)


def default_base_image() -> str:
    """The Dockerfile's own base image."""
    for line in (package_data.root() / _DOCKERFILE).read_text(encoding="utf-8").splitlines():
        if line.startswith("ARG BASE_IMAGE="):
            return line.partition("=")[2].strip()
    raise ValueError(f"{_DOCKERFILE} names no BASE_IMAGE")


_OLDEST_GLIBC = 17  # manylinux2014 is glibc 2.17
_QUESTION = "import platform, sys; print(sys.version_info[1], platform.machine(), platform.libc_ver()[1] or '-')"


class WheelsError(Exception):
    """Wheels that cannot be provided; one sentence."""

    usage = False


@dataclass(frozen=True)
class Python:
    """The Python of a base image: the minor version, the machine such as ``aarch64``, and glibc's minor version."""

    minor: int
    machine: str
    glibc: int

    def platforms(self) -> list[str]:
        """Compatible wheel platforms, the newest first (PEP 600)."""
        newest = range(max(self.glibc, _OLDEST_GLIBC), _OLDEST_GLIBC - 1, -1)
        return [*(f"manylinux_2_{minor}_{self.machine}" for minor in newest), f"manylinux2014_{self.machine}"]


def python_of(image: str, platform: str = "") -> Python:
    """Asks an image, of a platform; the engine pulls it when it is missing. Raises WheelsError."""
    words = ("--platform", platform) if platform else ()
    try:
        answer = docker_command.ask(
            "run", "--rm", *words, "--network", "none", "--entrypoint", "python3", image, "-c", _QUESTION
        )
        minor, machine, glibc = answer.split()
        return Python(int(minor), machine, int(glibc.split(".")[1]))
    except docker_command.DockerError as error:
        foreign = f" for {platform}, which this machine may not run without QEMU" if platform else ""
        raise WheelsError(f"base image {image} does not run python3{foreign}: {error}") from None
    except (ValueError, IndexError):
        raise WheelsError(f"base image {image} has no Python with glibc, which the wheels need") from None


def cache_folder() -> Path:
    """Where downloaded wheels are kept from build to build."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "dodo" / "wheels"


def provide_wheels(python: Python, cache: Path) -> Path:
    """A folder with a wheel for each package of the images and nothing else, all with its hashes; raises WheelsError.

    It is named after the lock, and appears only when it is complete.
    """
    root = package_data.root()
    locks = [(root / LOCK).read_text()]
    if python.machine == "x86_64":
        words = ("sh", root / _LOCKED, root / _OF_ROS, root / LOCK, root / _EXTRAS)
        locks.append(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
    folder = cache / hashlib.sha256((repr(python) + "".join(locks)).encode()).hexdigest()[:16]
    if not folder.is_dir():
        with contextlib.suppress(FileExistsError), atomic.new_folder(folder) as part:  # another build may be faster
            for number, lock in enumerate(locks):
                file = part / f"{number}.lock"
                file.write_text(lock)
                _download(python, file, part)
                file.unlink()
    return folder


def _download(python: Python, lock: Path, folder: Path) -> None:
    words = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "download"]
    words += ["--dest", str(folder), "--only-binary", ":all:", "--implementation", "cp", "--no-deps"]
    words += ["--python-version", f"3.{python.minor}", "--require-hashes", "--requirement", str(lock)]
    words += [word for platform in python.platforms() for word in ("--platform", platform)]
    result = subprocess.run(words, capture_output=True, text=True, errors="replace", check=False)
    if result.returncode:
        said = [line.strip() for line in result.stderr.splitlines() if line.strip()]
        why = next((line for line in reversed(said) if line.startswith("ERROR")), said[-1] if said else "")
        raise WheelsError(f"pip cannot download wheels for Python 3.{python.minor} on {python.machine}: {why}")
