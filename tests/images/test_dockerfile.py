"""The Dockerfile has a stage for each service, and says of it what its manifest says."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dodo_dsl import __version__
from dodo_dsl.images.names import SANDBOX, SHARED, known
from dodo_dsl.spec.manifest import Manifest, load_manifests
from tests.images.dockerfile import ROOT, stages
from tests.images.service_folders import folders_of

MANIFESTS, _ = load_manifests()
DOCKERFILES = (ROOT / "services" / "Dockerfile", ROOT / "examples" / "kiwi" / "Dockerfile")


@pytest.mark.parametrize("manifest", MANIFESTS.values(), ids=lambda m: m.name)
def test_each_service_has_a_stage_that_starts_it(manifest: Manifest) -> None:
    stage = stages()[manifest.image]
    assert stage.entrypoint == ["python3", *manifest.process[1:]]
    assert stage.copies == [(f"/opt/dodo/services/{name}", f"services/{name}") for name in folders_of(manifest)]
    assert stage.labels == {"org.opencontainers.image.title": manifest.image, "dodo.service": manifest.name}
    assert stage.stands_on in ("base", "geometry", "vision")


def test_every_image_is_a_stage() -> None:
    names = known(MANIFESTS.values())
    assert set(names) <= set(stages())
    assert {SANDBOX, *SHARED} <= set(names)


def test_shared_stages_are_a_chain_so_that_layers_are_shared() -> None:
    found = stages()
    assert [found[n].stands_on for n in ("python-vision", "python-geometry")] == ["python-geometry", "python"]
    assert [found[n].stands_on for n in ("base", "geometry", "vision")] == [
        "python",
        "python-geometry",
        "python-vision",
    ]


def test_every_requirement_is_locked() -> None:
    folder, names = ROOT / "services" / "requirements", []
    for file in folder.glob("*.txt"):
        words = ["sh", str(folder / "locked"), str(file), str(ROOT / "locks" / "base.txt")]
        lines = subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()
        names += [line.partition("==")[0].lower() for line in lines if not line.startswith(" ")]
        assert len([line for line in lines if line.strip().startswith("--hash=sha256:")]) >= len(names) > 0
        wanted = [line.lower() for line in file.read_text().splitlines() if not line.startswith("#")]
        assert sorted(names[-len(wanted) :]) == sorted(wanted)
    assert len(names) >= 7


def test_a_requirement_that_is_not_locked_ends_the_build(tmp_path: Path) -> None:
    (tmp_path / "radar.txt").write_text("# radar\nnumpy\nlibradar\n")
    words = ["sh", str(ROOT / "services" / "requirements" / "locked"), str(tmp_path / "radar.txt")]
    done = subprocess.run([*words, str(ROOT / "locks" / "base.txt")], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "libradar is not locked\n")


def test_the_example_stands_on_this_version() -> None:
    default = re.search(r"^ARG DODO_BASE=(\S+)$", DOCKERFILES[1].read_text(), re.MULTILINE)
    assert default and default[1] == f"dodo/vision:{__version__}"


@pytest.mark.parametrize("path", DOCKERFILES, ids=lambda p: p.parent.name)
def test_hadolint_has_nothing_to_say(path: Path) -> None:
    hadolint = shutil.which("hadolint") or shutil.which("hadolint", path=str(Path(sys.executable).parent))
    if hadolint is None:
        pytest.skip("hadolint is not installed")
    result = subprocess.run([hadolint, str(path)], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stdout) == (0, "")
