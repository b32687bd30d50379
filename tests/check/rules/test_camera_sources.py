"""What a rig's computer can take pictures from."""

from pathlib import Path

import pytest

from dodo_dsl.check.rules.camera_sources import check
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
    ],
)
def test_sources(rig: str, source: str, width: int, count: int, tmp_path: Path) -> None:
    assert [rule for rule, _ in found(check, example(rig, source, width), tmp_path)] == ["camera-source"] * count


def test_ways_out(tmp_path: Path) -> None:
    (problem,) = check(context(example("kiwi", "rpicm"), tmp_path))
    assert (problem.message, problem.hint) == ("'rpicm' is not a source of pictures", "did you mean 'rpicam'?")
    (problem,) = check(context(example("kiwi", "rpicam", 600), tmp_path))
    assert problem.hint == "write a width of 576"
