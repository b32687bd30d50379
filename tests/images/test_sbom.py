"""Bills of materials have CycloneDX's form, and name what is installed."""

import json
import sys
from importlib import metadata
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator

from dodo_dsl.cli.main import main
from dodo_dsl.images import sbom

_DIGEST = "ab" * 32
TOLD = {
    "python": [["PyYAML", "6.0.3", "MIT License"], ["sysv_ipc", "1.2.0", ""], ["av", "18.0", "MIT"]],
    "debian": [["bash", "5.2.15-2+b7", "amd64", ["GFDL-1.3", "GPL-3"]], ["dash", "1:0.5", "amd64", []]],
    "system": ["debian", "12"],
}


def check(text: str) -> dict[str, Any]:
    """The bill, which CycloneDX's schema allows, and whose references are unique."""
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None
    bill: dict[str, Any] = json.loads(text)
    references = [component["bom-ref"] for component in (bill["metadata"]["component"], *bill["components"])]
    assert len(set(references)) == len(references)
    return bill


def told_by(folder: Path, monkeypatch: pytest.MonkeyPatch, told: str) -> None:
    """A docker command whose images say what they are made of."""
    docker = folder / "docker"
    lines = [
        f"#!{sys.executable}",
        "import sys",
        f"answers = {{'run': {told!r}, 'image': 'sha256:{_DIGEST}', 'version': '28.0'}}",
        "print(answers[sys.argv[1]])",
    ]
    docker.write_text("\n".join(lines))
    docker.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))


def test_an_image_names_pythons_packages_and_debians(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told_by(tmp_path, monkeypatch, json.dumps(TOLD))
    bill = check(sbom.of_image("base", "dodo/base:1"))
    assert bill["metadata"]["component"] == {
        "bom-ref": "base@1",
        "type": "container",
        "name": "base",
        "version": "1",
        "hashes": [{"alg": "SHA-256", "content": _DIGEST}],
    }
    components = sorted(bill["components"], key=lambda component: str(component["purl"]))
    assert [component["purl"] for component in components] == [
        "pkg:deb/debian/bash@5.2.15-2%2Bb7?arch=amd64&distro=debian-12",
        "pkg:deb/debian/dash@1:0.5?arch=amd64&distro=debian-12",
        "pkg:pypi/av@18.0",
        "pkg:pypi/pyyaml@6.0.3",
        "pkg:pypi/sysv-ipc@1.2.0",
    ]
    licences = [component.get("licenses") for component in components]
    assert licences[0] == [{"license": {"name": "GFDL-1.3"}}, {"license": {"name": "GPL-3"}}]
    assert licences[1:] == [None, [{"license": {"id": "MIT"}}], [{"license": {"name": "MIT License"}}], None]


def test_an_image_that_says_nothing_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told_by(tmp_path, monkeypatch, "nothing")
    with pytest.raises(sbom.SbomError, match=r"^x:1 does not say what it is made of: Expecting value"):
        sbom.of_image("x", "x:1")


@pytest.mark.thorough
def test_the_environment_of_dodo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    stdout = StringIO()
    assert main(["images", "sbom", "--no-images", "-o", "bills"], stdout, stdout) == 0
    assert stdout.getvalue() == "wrote bills/python.cdx.json\n"
    text = (tmp_path / "bills" / "python.cdx.json").read_text()
    found = {component["name"]: component["version"] for component in check(text)["components"]}
    assert found["numpy"] == metadata.version("numpy")
    assert "dodo-dsl" not in found
    assert text == sbom.of_environment(), "the same every time"


@pytest.mark.thorough
def test_the_commands_write_a_bill_an_image(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told_by(tmp_path, monkeypatch, json.dumps(TOLD))
    monkeypatch.chdir(tmp_path)
    stdout = StringIO()
    assert main(["images", "sbom", "base", "collision"], stdout, stdout) == 0
    assert sorted(path.name for path in (tmp_path / "build" / "sbom").iterdir()) == [
        "base.cdx.json",
        "collision.cdx.json",
        "python.cdx.json",
    ]


@pytest.mark.slow
@pytest.mark.engine
def test_an_image_that_was_built(built: dict[str, str]) -> None:
    bill = check(sbom.of_image("gantry", built["gantry"]))
    found = {component["purl"].partition("@")[0] for component in bill["components"]}
    assert {"pkg:pypi/pyserial", "pkg:pypi/protobuf", "pkg:deb/debian/libc6"} <= found
    assert "pkg:pypi/numpy" not in found
    unlicensed = [
        row["name"] for row in bill["components"] if row["purl"].startswith("pkg:deb") and "licenses" not in row
    ]
    assert len(unlicensed) < 0.1 * len(found), unlicensed
