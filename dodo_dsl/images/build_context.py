"""The build context: what ``services/Dockerfile`` copies, and wheels for a build without a package index.

Sources come from a checkout or from an installed wheel. pip downloads wheels here, for the base image's Python.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.images.docker_command import DockerError, ask

BAKE = "services/docker-bake.hcl"
_LOCK, _EXTRAS = "locks/base.txt", "locks/extras.txt"
"""Versions of all packages, with the hashes of their wheels."""
_OF_ROS, _LOCKED = "services/requirements/ros.txt", "services/requirements/locked"
_DOCKERFILE = "services/Dockerfile"
_PARTS = ("build/firmware", "build/time", "locks", "schemas", "services", "templates", "tests_registry")
"""What a checkout has beside the package. The emulated rig, and what gives the test's time, may not be built."""


def assemble(folder: Path) -> None:
    """Copies what the images are made of into an empty folder, as a checkout has it, and with its dates.

    The engine identifies a context by its folder's name and transfers only files whose date has changed.
    """
    parts = {name: package_data.root() / name for name in _PARTS}
    parts["dodo_dsl"] = Path(package_data.__file__).parent
    for name, source in parts.items():
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__", "_data"))


def default_base_image() -> str:
    text = (package_data.root() / _DOCKERFILE).read_text(encoding="utf-8")
    return text.partition("ARG BASE_IMAGE=")[2].split()[0]


_TAGS = [*(f"manylinux_2_{minor}" for minor in range(36, 16, -1)), "manylinux2014"]
"""Of wheels that run on the glibc of the default base image, the newest first (PEP 600)."""
_QUESTION = "import platform, sys; print(sys.version_info[1], platform.machine())"


Python = tuple[int, str]
"""That of a base image: the minor version, and the machine such as ``aarch64``."""


def python_of(image: str, platform: str = "") -> Python:
    """Asks an image, of a platform; the engine pulls it when it is missing. Raises DockerError."""
    words = ("--platform", platform) if platform else ()
    try:
        answer = ask("run", "--rm", *words, "--network", "none", "--entrypoint", "python3", image, "-c", _QUESTION)
        minor, machine = answer.split()
        return int(minor), machine
    except DockerError as error:
        foreign = f" for {platform}, which this machine may not run without QEMU" if platform else ""
        raise DockerError(f"base image {image} does not run python3{foreign}: {error}") from None
    except ValueError:
        raise DockerError(f"base image {image} has no Python as expected, it says '{answer}'") from None


def download(python: Python, folder: Path) -> None:
    """Adds a wheel for each package of the images to a folder, all with its hashes; raises DockerError."""
    root, (_, machine) = package_data.root(), python
    locks = [(root / _LOCK).read_text(encoding="utf-8")]
    if machine == "x86_64":
        words = ("sh", root / _LOCKED, root / _OF_ROS, root / _LOCK, root / _EXTRAS)
        locks.append(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
    for lock in locks:
        with tempfile.NamedTemporaryFile("w", suffix=".txt", encoding="utf-8") as file:
            file.write(lock)
            file.flush()
            _download(python, file.name, folder)


def _download(python: Python, lock: str, folder: Path) -> None:
    minor, machine = python
    words = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "download"]
    words += ["--dest", str(folder), "--only-binary", ":all:", "--implementation", "cp", "--no-deps"]
    words += ["--python-version", f"3.{minor}", "--require-hashes", "--requirement", lock]
    words += [word for tag in _TAGS for word in ("--platform", f"{tag}_{machine}")]
    result = subprocess.run(words, capture_output=True, text=True, errors="replace", check=False)
    if result.returncode:
        said = [line.strip() for line in result.stderr.splitlines() if line.strip()]
        why = next((line for line in reversed(said) if line.startswith("ERROR")), said[-1] if said else "")
        raise DockerError(f"pip cannot download wheels for Python 3.{minor} on {machine}: {why}")
