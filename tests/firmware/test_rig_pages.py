"""The pages of docs/rigs: their numbers follow from the constants, and their commands and sentences exist."""

import contextlib
import json
import math
import re
import subprocess
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli import doctor
from dodo_dsl.cli.main import main
from dodo_dsl.spec.deployment import load_deployment
from firmware.parts import measures as of
from services.gantry.protocol import Status
from services.gantry.service import describe
from tests.firmware.programs import ROOT
from tests.firmware.reached import reached

FOLDER = ROOT / "docs" / "rigs"
PAGES = {page.stem: page.read_text() for page in sorted(FOLDER.glob("*.md"))}
SAID = sorted(
    {line.strip() for page in PAGES.values() for line in re.findall(r"(?:`|^    )(dodo [^`\n]+)", page, re.MULTILINE)}
)
BLOCKS = re.findall(r"```yaml\n(.*?)```", "".join(PAGES.values()), re.DOTALL)


def test_every_page_is_listed_and_says_that_nothing_was_built() -> None:
    listed = PAGES["index"].rpartition("{toctree}")[2].split("```")[0].split()[1:]
    assert {"index", *listed} == set(PAGES)
    assert "Nobody has built this rig yet" in PAGES["index"]


@pytest.mark.parametrize("line", SAID)
def test_commands_exist(line: str) -> None:
    words = line.split()[1:]
    named = words[:2] if words[0] == "rig" else words[:1]
    with contextlib.redirect_stdout(StringIO()) as help_text:
        assert main([*named, "--help"], help_text, StringIO()) == 0
    for flag in re.findall(r"(?<!\S)--?[a-z][a-z-]*", line):
        assert flag in help_text.getvalue(), f"{line}: no {flag}"


def test_what_make_is_told_exists() -> None:
    for line in re.findall(r"(?:`|^    )make( -C firmware)? ([a-z]+)", "\n".join(PAGES.values()), re.MULTILINE):
        words = ["make", "--dry-run", *line[0].split(), line[1]]
        assert subprocess.run(words, cwd=ROOT, capture_output=True, check=False).returncode == 0, line


def test_sentences_of_the_rig_are_those_that_it_says() -> None:
    page = PAGES["assembly"]
    assert f"`kiwi-dynamic: {describe(Status.FAULT)}`" in page
    assert f"`{describe(Status.IDLE)}, x = -0.900 m, y = -0.700 m, yaw = -150.9 degrees`" in page
    for words in ("gave no answer", "the place is out of the rig's ranges"):
        assert words in page
        assert any(words in file.read_text() for file in (ROOT / "services" / "gantry").glob("*.py")), words


def test_doctor_says_problem_where_the_page_looks_for_it() -> None:
    assert f"begins with `{doctor._SIGNS['problem']}`" in PAGES["assembly"]


@pytest.mark.parametrize("block", BLOCKS)
def test_deployments_are_valid(block: str, tmp_path: Path) -> None:
    (tmp_path / "dodo.yml").write_text(block if block.startswith("dodo: 1") else f"dodo: 1\n{block}")
    deployment, problems = load_deployment(tmp_path / "dodo.yml")
    assert not problems and "kiwi-dynamic" in deployment.rigs


def test_rails_have_the_lengths_of_the_constants() -> None:
    for axis in (of.X, of.Y):
        lengths = of.THESIS_RAILS[axis.name], axis.rail(), axis.rail(of.OVERTRAVEL)
        assert f"| {axis.name} | {' | '.join(f'{length:.0f} mm' for length in lengths)} |" in PAGES["parts"]
    short = of.Y.rail() - of.THESIS_RAILS["y"]
    assert f"{short:.0f} mm less of y" in PAGES["parts"] and f"y: {(of.Y.length - short) / 1000:g} m" in PAGES["parts"]
    assert of.X.rail() <= of.THESIS_RAILS["x"]


@pytest.mark.parametrize("name", ["rig-straight", "rig-oval", "static-rig"])
def test_cones_are_counted_as_the_map_has_them(name: str) -> None:
    models = json.loads((ROOT / "tests_registry" / "maps" / name / "map.json").read_text())["model"]
    count = {model["name"]: len(model["instances"]) for model in models}
    places = [place for model in models for place in model["instances"]]
    cells = [str(count.get(f"cone_{colour}", 0)) for colour in ("yellow", "blue", "red")]
    for axis in (0, 1):
        along = [place[axis] for place in places]
        cells.append(f"{min(along):.2f} to {max(along):.2f} m")
    assert f"| `{name}` | {' | '.join(cells)} |" in PAGES["parts"]


def test_effects_follow_from_the_conversion() -> None:
    x, y, yaw = (axis.high for axis in (of.X, of.Y, of.YAW))
    direct = of.CIRCLE_STEP * of.YAW.steps  # what the firmware counts for a turn's degree
    rows = {
        "c of x": f"{0.001 * x:.2f} mm at x = 0.95 m",
        "c of y": f"{0.001 * y:.2f} mm at y = 0.7 m",
        "c of the yaw | 1 %": f"{yaw * 0.01 / 1.01:.2f} degrees at 170 degrees",
        "c of the yaw: 0.55": f"{yaw * (1 - direct):.2f} degrees at 170 degrees",
        "offset of x or y": f"{1000 / of.X.steps:.2f} mm everywhere",
        "offset of the yaw": f"{1 / of.YAW.steps:.2f} degrees everywhere",
        "y1 and y2 apart": f"{math.degrees(math.atan(0.001 / 1.95)):.2f} degrees of yaw over 1.95 m",
        "beam not square": f"{y * math.tan(math.radians(0.1)):.2f} mm of x at y = 0.7 m",
        "lens higher": f"{240 / math.tan(math.radians(24.4)) * 0.001 / 0.5:.2f} px",
    }
    for begin, effect in rows.items():
        (row,) = [line for line in PAGES["tolerances"].splitlines() if line.startswith(f"| {begin}")]
        assert effect in row, (row, effect)


@pytest.mark.parametrize(("name", "places"), [("x", 5), ("x", 9), ("yaw", 5), ("yaw", 9), ("yaw", 15)])
def test_what_measuring_reaches_follows_from_the_fit(name: str, places: int) -> None:
    per, unit, axes = (1, "deg", "yaw") if name == "yaw" else (1000, "mm", "x, y")
    typical, most = (f"{value * per:.2f} {unit}" for value in reached(name, places))
    assert f"| {axes} | {places} | {typical} | {most} |" in PAGES["tolerances"]
    if name == "x":
        assert reached("y", places) == pytest.approx(reached("x", places))
