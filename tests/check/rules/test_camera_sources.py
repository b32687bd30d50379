"""What a rig's computer can take pictures from."""

from pathlib import Path

import pytest

from dodo_dsl.check.service_rules import check_camera_sources
from tests.check.contexts import context, found


def example(rig: str, source: str, width: int = 640) -> str:
    camera = f"{{source: {source}, width: {width}, height: 480}}"
    test = f"level: hil\nrig: {rig}\nenvironment:\n  camera: {{uses: camera}}\n"
    return f"{test}# dodo.yml\nrigs: {{kiwi: {{kind: static, cid: 121, camera: {camera}}}}}\n"


@pytest.mark.parametrize(
    ("rig", "source", "width", "count"),
    [
        ("kiwi", "/dev/video0", 600, 0),
        ("kiwi", "rpicam", 640, 0),
        ("kiwi", "drive.rec", 600, 0),
        ("emulated", "rpicam", 640, 0),
        ("kiwi", "rpicam", 600, 1),
        ("kiwi", "emulated", 640, 1),
        ("kiwi", "webcam", 640, 1),
        ("kiwi", "file", 640, 1),
        ("kiwi", "rpicam", 641, 1),
    ],
)
def test_sources(rig: str, source: str, width: int, count: int, tmp_path: Path) -> None:
    assert [rule for rule, _ in found(check_camera_sources, example(rig, source, width), tmp_path)] == [
        "camera-source"
    ] * count


def test_ways_out(tmp_path: Path) -> None:
    (problem,) = check_camera_sources(context(example("kiwi", "rpicm"), tmp_path))
    assert (problem.message, problem.hint) == ("'rpicm' is not a source of frames", "did you mean 'rpicam'?")
    (problem,) = check_camera_sources(context(example("kiwi", "rpicam", 600), tmp_path))
    assert problem.hint == "write a width of 576"


@pytest.mark.parametrize(
    ("source", "written", "said"),
    [
        ("rpicam", "freq: 10 Hz", []),
        ("rpicam", "freq: 30 Hz, exposure: 33 ms", []),
        ("drive.rec", "freq: 30 Hz", []),
        ("/dev/video0", "freq: 30 Hz", ["an exposure of 100 ms does not fit into the 33.3 ms between two frames"]),
        ("rpicam", "exposure: 0.2 s", ["an exposure of 200 ms does not fit into the 100 ms between two frames"]),
    ],
)
def test_exposures(source: str, written: str, said: list[str], tmp_path: Path) -> None:
    test = example("kiwi", source).replace("{uses: camera}", f"{{uses: camera, with: {{{written}}}}}")
    assert [message for _, message in found(check_camera_sources, test, tmp_path)] == said


@pytest.mark.parametrize(("level", "camera"), [("sil", "virtual-camera"), ("hil\nrig: kiwi", "camera")])
def test_odd_sizes(level: str, camera: str, tmp_path: Path) -> None:
    test = f"level: {level}\nenvironment:\n  camera: {{uses: {camera}, with: {{width: 641, height: 479}}}}\n"
    test += "# dodo.yml\nrigs: {kiwi: {kind: static, cid: 121, camera: {source: /dev/video0}}}\n"
    assert found(check_camera_sources, test, tmp_path) == [
        ("out-of-range", "parameter 'width' is 641, expected an even number"),
        ("out-of-range", "parameter 'height' is 479, expected an even number"),
    ]


def test_an_odd_height_of_a_raspberry_pi_s_camera(tmp_path: Path) -> None:
    test = example("kiwi", "rpicam").replace("height: 480", "height: 479")
    assert [rule for rule, _ in found(check_camera_sources, test, tmp_path)] == ["out-of-range"]
