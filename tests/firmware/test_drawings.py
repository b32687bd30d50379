"""Drawings and printed parts of the rig have the firmware's measures."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml

from firmware.parts import measures as of
from firmware.parts import parts
from tests.firmware.programs import ROOT

FOLDER = ROOT / "docs" / "rigs"
TABLE = yaml.safe_load((ROOT / "firmware" / "protocol.yml").read_text())


def words(name: str) -> list[str]:
    svg = ET.fromstring((FOLDER / f"{name}.svg").read_text())
    return [text.text or "" for text in svg.iter("{http://www.w3.org/2000/svg}text")]


def test_measures_are_those_of_the_firmware() -> None:
    axes, top = TABLE["axes"], words("top")
    for name in ("x", "y"):
        low = axes[name]["offset_steps"] / axes[name]["steps_per_m"] * 1000
        assert f"{low:g} = {axes[name]['offset_steps']} steps / {axes[name]['steps_per_m']} per m" in top
        assert f"{axes[name]['high_m'] * 1000:g}" in top
    yaw = axes["yaw"]
    said = " ".join(words("yaw-dynamic"))
    assert f"step 0: -{yaw['offset_steps'] / yaw['steps_per_deg']:.1f} = -{yaw['offset_steps']} steps / " in said
    assert f"highest: {yaw['high_deg']};" in said
    circle, index = " ".join(words("yaw-circle")), TABLE["circle"]["index"]["width_deg"]
    assert f"index closed from {180 - index} to 180" in circle and "step 0: -180" in circle
    assert f"{360 / TABLE['circle']['yaw']['steps_per_turn']:g} degrees a full step" in circle


def test_switches_are_where_the_emulated_rig_has_them() -> None:
    source = (ROOT / "firmware" / "emulator" / "plant" / "plant.c").read_text()
    (row,) = re.findall(r"ends\[AXES\] = \{\{(.*?)\}\};", source)
    x, y, yaw = ([float(number) for number in each.split(", ")] for each in row.split("}, {"))
    assert x == y and [1000 * number for number in (x[0], x[1], x[3])] == [of.HOME_CLOSES, of.FAR_CLOSES, of.FRAME]
    assert [yaw[0], yaw[1], yaw[3]] == [of.YAW_HOME_CLOSES, of.YAW_FAR_CLOSES, of.YAW_FRAME]


def test_the_lens_is_where_projected_truth_has_it_by_default() -> None:
    manifest = yaml.safe_load((ROOT / "services" / "projected_truth" / "service.yml").read_text())
    assert manifest["parameters"]["z"]["default"] == of.LENS / 1000
    assert f"{of.LENS:g}: lens" in words("side")


def test_the_hub_passes_above_the_highest_cone() -> None:
    assert parts.lowest() - 5 > parts.finish_cone().bounds[1][2]


SIZES = {
    "cone": (24, 24, 34),
    "finish-cone": (48, 48, 68),
    "hub-plate": (134, 70, 4),
    "camera-plate": (60, 40, 4),
    "index-cam": (55, 50, 6),
}


@pytest.mark.parametrize("name", parts.PARTS)
def test_a_part_can_be_printed(name: str) -> None:
    mesh = parts.PARTS[name]()
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0 and mesh.body_count == 1
    size = mesh.bounds[1] - mesh.bounds[0]
    assert size == pytest.approx(SIZES[name], abs=0.1)
    assert max(size) <= parts.BED and mesh.bounds[0][2] == 0
    assert f"| `{name}.stl` | {' x '.join(map(str, SIZES[name]))} |" in (FOLDER / "printing.md").read_text()


def test_plates_have_the_sizes_and_holes_of_their_drawing() -> None:
    said = words("holder")
    assert {"134", "70", "60", "58", "49", "21", "12.5", "window 10 x 10; 4 x 2.2"} <= set(said)
    for mesh, holes in ((parts.hub_plate(), 11), (parts.camera_plate(), 5)):
        assert mesh.euler_number == 2 - 2 * holes


def test_cones_are_those_of_the_maps() -> None:
    for file in ("cone.obj", "finish-cone.obj"):
        for drawn in sorted((ROOT / "tests_registry" / "maps").glob(f"*/{file}")):
            corners = [line.split()[1:] for line in drawn.read_text().splitlines() if line.startswith("v ")]
            reach = 1000 * np.array(corners, float)
            assert parts.cone(file).bounds == pytest.approx(np.array([reach.min(0), reach.max(0)]), abs=1e-3)


def test_the_cam_is_high_over_the_index_that_ends_backward() -> None:
    corners = parts.index_cam().vertices
    high = corners[np.hypot(corners[:, 0], corners[:, 1]) > (parts.CAM + parts.CAM_LOW) / 2]
    angles = np.degrees(np.arctan2(high[:, 1], high[:, 0])) % 360
    assert (angles.min(), angles.max()) == pytest.approx((180 - TABLE["circle"]["index"]["width_deg"], 180))


def test_files_are_the_same_each_time_and_small(tmp_path: Path) -> None:
    files = parts.write(tmp_path / "one")
    assert [file.name for file in files] == [f"{name}.stl" for name in parts.PARTS]
    for file, again in zip(files, parts.write(tmp_path / "two"), strict=True):
        assert file.read_bytes() == again.read_bytes() and len(file.read_bytes()) < 100_000
        assert trimesh.load_mesh(file).is_watertight


def test_the_wiring_is_that_of_the_table_of_the_firmware() -> None:
    rows = re.findall(r"^\| (D\d+) \| (P[BD]\d)", (ROOT / "firmware" / "README.md").read_text(), re.MULTILINE)
    source = (ROOT / "firmware" / "gantry" / "avr" / "main.c").read_text()
    assert {(pin, port) for port, pin in re.findall(r"#define \w+ (P[BD]\d+) +/\* (D\d+)", source)} == set(rows)
    said = words("wiring")
    assert [word for word in said if word.startswith("L6470 ")] == [
        f"L6470 {name}" for name in TABLE["drivers"]["motors"]
    ]
    assert {pin for pin, _ in rows} <= set(said)
