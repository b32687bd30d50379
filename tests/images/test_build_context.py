"""The build context holds what the Dockerfile copies, from this checkout, and its definition names the images."""

import json
import re
from pathlib import Path

import pytest

from dodo_dsl import __version__, package_data
from dodo_dsl.images import build_context
from dodo_dsl.images.names import Image
from tests.images.dockerfile import ROOT, stages


def files(folder: Path) -> set[str]:
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}


def test_context_has_the_bus_and_the_services_and_no_more(tmp_path: Path) -> None:
    build_context.assemble(tmp_path, None)
    found = files(tmp_path)
    assert {"locks/base.txt", "dodo_dsl/__init__.py", "dodo_dsl/opendlv/messages.odvd"} <= found
    assert {"services/base/process.py", "services/collision/service.yml", "services/Dockerfile.dockerignore"} <= found
    assert not [name for name in found if "__pycache__" in name or name.startswith(("dodo_dsl/cli", "wheels", "tests"))]
    assert (tmp_path / "services/base/loop.py").stat().st_mtime == (ROOT / "services/base/loop.py").stat().st_mtime


def test_the_whole_of_dodo_has_what_its_stage_copies(tmp_path: Path) -> None:
    build_context.assemble(tmp_path, None, whole=True)
    copied = re.findall(r"^COPY (\w+) \w+$", stages()["dodo-code"].text, re.MULTILINE)
    assert sorted(copied) == sorted(path.name for path in tmp_path.iterdir() if path.name not in ("rig", "time"))
    assert {"dodo_dsl/cli/main.py", "schemas/dodo.schema.json", "templates/report/suite.css"} <= files(tmp_path)


def test_what_gives_the_test_s_time_comes_along(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root, built = tmp_path / "root", tmp_path / "root" / "build" / "time"
    built.mkdir(parents=True)
    for name in ("services", "locks"):
        (root / name).symlink_to(ROOT / name)
    monkeypatch.setattr(package_data, "root", lambda: root)
    (built / "dodo-time").touch()
    (tmp_path / "half").mkdir()
    build_context.assemble(tmp_path / "half", None)
    assert not (tmp_path / "half" / "time").exists()
    (built / "libdodo-time.so").touch()
    (tmp_path / "whole").mkdir()
    build_context.assemble(tmp_path / "whole", None)
    assert files(tmp_path / "whole" / "time") == {"dodo-time", "libdodo-time.so"}


def test_the_emulated_rigs_come_along_where_both_builds_of_the_firmware_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root, firmware = tmp_path / "root", tmp_path / "root" / "build" / "firmware"
    firmware.mkdir(parents=True)
    for name in ("services", "locks"):
        (root / name).symlink_to(ROOT / name)
    monkeypatch.setattr(package_data, "root", lambda: root)
    for name in ("rig-emulator", "gantry.elf", "gantry-circle.elf"):
        folder = tmp_path / name
        folder.mkdir()
        build_context.assemble(folder, None)
        assert not (folder / "rig").exists()
        (firmware / name).touch()
    build_context.assemble(tmp_path / "root" / "build", None)
    assert files(tmp_path / "root" / "build" / "rig") == {"rig-emulator", "gantry.elf", "gantry-circle.elf"}


def test_wheels_come_along(tmp_path: Path) -> None:
    wheels, folder = tmp_path / "wheels", tmp_path / "context"
    wheels.mkdir()
    folder.mkdir()
    (wheels / "radar-1.0-py3-none-any.whl").write_bytes(b"PK")
    build_context.assemble(folder, wheels)
    assert (folder / "wheels" / "radar-1.0-py3-none-any.whl").read_bytes() == b"PK"


def test_definition_names_targets_tags_and_arguments(tmp_path: Path) -> None:
    images = [Image("base", "here/base:1"), Image("collision", "here/collision:1")]
    build_context.define(tmp_path, images, "https://git.example.org/dodo", "debian-with-python")
    definition = json.loads((tmp_path / build_context.DEFINITION).read_text())
    assert definition["group"]["default"]["targets"] == ["base", "collision"]
    target = definition["target"]["collision"]
    assert (target["target"], target["tags"]) == ("collision", ["here/collision:1"])
    assert target["args"] == {
        "BASE_IMAGE": "debian-with-python",
        "VERSION": __version__,
        "SOURCE": "https://git.example.org/dodo",
    }


def test_without_a_base_image_the_dockerfile_decides(tmp_path: Path) -> None:
    build_context.define(tmp_path, [Image("base", "here/base:1")], "")
    definition = json.loads((tmp_path / build_context.DEFINITION).read_text())
    assert "BASE_IMAGE" not in definition["target"]["base"]["args"]
    assert build_context.default_base_image().startswith("python:3.")
