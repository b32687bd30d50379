"""``dodo rig measure --camera`` and ``dodo rig board``."""

import contextlib
import json
import sys
from collections.abc import Callable, Iterator
from io import StringIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from dodo_dsl.cli import rig_camera
from dodo_dsl.cli.main import main
from dodo_dsl.run.rigs import access
from dodo_dsl.run.rigs.access import Command
from dodo_dsl.spec.deployment import load_deployment
from dodo_dsl.spec.manifest import load_manifests
from tests.calibration.board_pictures import pictures

RIGS = "dodo: 1\nrigs:\n  desk: {kind: static, cid: 120, camera: {source: rpicam, width: 640, height: 480}}  # mine\n"


def dodo(*words: str, code: int) -> str:
    output = StringIO()
    assert main(["rig", *words], output, output) == code, output.getvalue()
    return output.getvalue()


@pytest.mark.thorough
def test_a_camera_is_measured_by_pictures_and_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dodo.yml").write_text(RIGS)
    (tmp_path / "seen").mkdir()
    for number, picture in enumerate(pictures()):
        cv2.imwrite(str(tmp_path / "seen" / f"{number}.png"), picture)
    (tmp_path / "seen" / "none.jpg").write_bytes(b"no picture")
    assert json.loads(dodo("measure", "desk", "--pictures", "seen", "--dry-run", "--json", code=0).split("\n", 1)[1])
    assert (tmp_path / "dodo.yml").read_text() == RIGS
    said = dodo("measure", "desk", "--pictures", "seen", code=0)
    assert (
        "none.jpg: not used, because it is not a picture" in said and "desk: 9 pictures of 640 x 480: focal-x " in said
    )
    text = (tmp_path / "dodo.yml").read_text()
    assert text.endswith("}}}  # mine\n")
    found = yaml.safe_load(text)["rigs"]["desk"]["camera"]
    assert (found["source"], found["intrinsics"]["width"], found["intrinsics"]["height"]) == ("rpicam", 640, 480)
    assert float(found["intrinsics"]["focal-y"].removesuffix(" px")) == pytest.approx(528, rel=0.002)
    deployment, problems = load_deployment(tmp_path / "dodo.yml")
    assert not problems and deployment.rigs["desk"].text("camera.intrinsics.fovy").startswith("48.9")
    parameters = load_manifests(())[0]["projected-truth"].parameters
    given = {name: access._of_rig(deployment.rigs["desk"], about).value for name, about in parameters.items()}
    assert given["fovy"] and float(given["fovy"].text) == pytest.approx(48.887, abs=0.1)
    k1, p1 = given["distortion.k1"], given["distortion.p1"]
    assert k1 and p1 and (float(k1.text), float(p1.text)) == pytest.approx((-0.12, 0.001), abs=0.01)


@pytest.mark.thorough
def test_a_camera_is_measured_in_a_dialogue(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = [np.full((480, 640), 235, np.uint8), *pictures()]
    asked = []

    @contextlib.contextmanager
    def occupied(*_: object) -> Iterator[Callable[[Command], dict[str, Any]]]:
        def query(command: Command) -> dict[str, Any]:
            asked.append(command)
            output = next(word for word in command[1] if word.startswith("--output="))
            cv2.imwrite(output.removeprefix("--output="), shown[len(asked) - 1])
            return {"ok": True}

        yield query

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(rig_camera, "occupied", occupied)
    monkeypatch.setattr(rig_camera, "PICTURES", 9)
    monkeypatch.setattr(sys, "stdin", StringIO("\n" * 10))
    (tmp_path / "dodo.yml").write_text(RIGS)
    said = dodo("measure", "desk", "--camera", "--dry-run", code=0)
    assert "it shows fewer than 12 corners of the board: once more" in said and "desk: 9 pictures of" in said
    assert len(asked) == 10 and "--source=rpicam" in asked[0][1] and "services.camera.snapshot" in asked[0][0]
    monkeypatch.setattr(sys, "stdin", StringIO(""))
    assert "standard input ended" in dodo("measure", "desk", "--camera", code=2)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--pictures", "none"], "--pictures: none is not a folder"),
        (["--pictures", "."], "--pictures: . has no .png or .jpg"),
    ],
)
def test_what_has_no_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], said: str) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dodo.yml").write_text(RIGS)
    assert said in dodo("measure", "desk", *words, code=2)


def test_the_board_is_written_once(tmp_path: Path) -> None:
    file = tmp_path / "board.svg"
    assert "9 x 6 squares of 28 mm on A4" in dodo("board", "-o", str(file), code=0)
    assert file.read_text().startswith("<svg ")
    assert "exists" in dodo("board", "-o", str(file), code=2)


def test_the_board_is_an_svg_file(tmp_path: Path) -> None:
    said = dodo("board", "-o", str(tmp_path / "board.png"), code=2)
    assert "is not the name of an SVG file, expected one that ends in .svg" in said
    assert not (tmp_path / "board.png").exists()
