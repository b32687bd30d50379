"""The bake file has a target for each image, which starts what the manifest says."""

import re
import subprocess
from pathlib import Path

from dodo_dsl import __version__
from dodo_dsl.cli.images import DODO, SANDBOX, SHARED, known
from dodo_dsl.spec.manifest import load_manifests
from tests.images.conftest import ROOT
from tests.images.targets import folders_of, targets

MANIFESTS, _ = load_manifests()


def test_every_image_is_a_target_with_a_stage() -> None:
    assert set(targets()) == {*known(MANIFESTS.values()), DODO}
    stages = re.findall(r"^FROM \S+ AS (\S+)$", (ROOT / "services" / "Dockerfile").read_text(), re.MULTILINE)
    wanted = {target["target"] for target in targets().values()}
    assert wanted == {"service", SANDBOX, DODO, *SHARED} and wanted <= set(stages)
    assert {target["args"]["STAGE"] for target in targets().values() if "args" in target} <= set(stages)


def test_services_stand_on_what_they_import_and_start_as_their_manifest_says() -> None:
    for manifest in MANIFESTS.values():
        target = targets()[manifest.image]
        assert (target["target"], target["args"]["FOLDER"]) == ("service", manifest.folder.name)
        assert [*manifest.process[1:]] == ["-m", f"services.{manifest.folder.name}"]
        assert target["labels"]["dodo.service"] == manifest.name == target["labels"]["org.opencontainers.image.title"]
        sources = "".join(path.read_text() for path in manifest.folder.rglob("*.py"))
        imported = set(re.findall(r"^(?:from|import) services\.(\w+)", sources, re.MULTILINE))
        assert imported - {"base"} <= folders_of(manifest.image), manifest.name


def test_every_requirement_is_locked() -> None:
    folder, names = ROOT / "services" / "requirements", []
    for file in folder.glob("*.txt"):
        locks = [str(ROOT / "locks" / name) for name in ("base.txt", "extras.txt")]
        words = ["sh", str(folder / "locked"), str(file), *locks]
        lines = subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()
        found = [line.partition("==")[0].lower() for line in lines if not line.startswith(" ")]
        assert len([line for line in lines if line.strip().startswith("--hash=sha256:")]) >= len(found) > 0
        names += found
        wanted = [line.lower() for line in file.read_text().splitlines() if not line.startswith("#")]
        assert sorted(names[-len(wanted) :]) == sorted(wanted)
    assert len(names) >= 7


def test_a_requirement_that_is_not_locked_ends_the_build(tmp_path: Path) -> None:
    (tmp_path / "radar.txt").write_text("# radar\nnumpy\nlibradar\n")
    words = ["sh", str(ROOT / "services" / "requirements" / "locked"), str(tmp_path / "radar.txt")]
    done = subprocess.run([*words, str(ROOT / "locks" / "base.txt")], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "libradar is not locked\n")


def test_the_example_stands_on_this_version() -> None:
    default = re.search(r"^ARG DODO_BASE=(\S+)$", (ROOT / "examples" / "kiwi" / "Dockerfile").read_text(), re.MULTILINE)
    assert default and default[1] == f"dodo/vision:{__version__}"
