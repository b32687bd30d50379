"""The locked packages: complete, with the pinned versions, and with hashes for both machines."""

import re
import tomllib
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
_HASH = re.compile(r"    --hash=sha256:[0-9a-f]{64}( \\)?")


def locked(name: str) -> dict[str, tuple[str, int]]:
    """Version and number of hashes of each package in a lock."""
    found: dict[str, tuple[str, int]] = {}
    package = ""
    for line in (ROOT / "locks" / f"{name}.txt").read_text().splitlines()[1:]:
        if line.startswith(" "):
            assert _HASH.fullmatch(line), line
            found[package] = found[package][0], found[package][1] + 1
        else:
            requirement = Requirement(line.removesuffix("\\"))
            package = canonicalize_name(requirement.name)
            assert package not in found
            found[package] = str(requirement.specifier).removeprefix("=="), 0
    return found


PACKAGES = locked("base") | locked("extras") | locked("dev")


def test_versions_are_those_of_the_constraints() -> None:
    pins = dict(line.split("==") for line in (ROOT / "constraints.txt").read_text().split())
    assert {canonicalize_name(name): version for name, version in pins.items()} == {
        name: version for name, (version, _) in PACKAGES.items()
    }


def test_each_package_has_hashes() -> None:
    counts = {name: count for name, (_, count) in PACKAGES.items()}
    assert min(counts.values()) >= 1
    assert min(counts[name] for name in ("numpy", "opencv-python-headless", "shapely", "av")) >= 2, "two machines"


def test_nothing_that_is_needed_is_missing() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    base = {canonicalize_name(Requirement(text).name) for text in project["dependencies"]}
    extra = {canonicalize_name(Requirement(text).name) for text in project["optional-dependencies"]["dev"]}
    assert base | {"hatchling", "editables"} <= set(locked("base"))
    assert base | extra <= set(PACKAGES)
    here = {canonicalize_name(d.metadata["Name"]) for d in metadata.distributions()}
    for name in here & set(PACKAGES):
        for text in metadata.requires(name) or ():
            needed = Requirement(text)
            if needed.marker is None or needed.marker.evaluate({"extra": ""}):
                assert canonicalize_name(needed.name) in PACKAGES, f"{name} needs {needed.name}"
