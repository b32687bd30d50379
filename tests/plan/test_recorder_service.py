"""The recorder of every test."""

from pathlib import Path

import pytest

from dodo_dsl.plan.added_services import recorder
from dodo_dsl.plan.model import Flag
from dodo_dsl.spec.manifest import load_manifests
from tests.check.contexts import resolved

MANIFEST = load_manifests()[0]["rec-recorder"]


def flags(example: str, folder: Path) -> list[Flag]:
    return list(recorder(resolved(example, folder), MANIFEST, "dodo/recorder:1", 140).flags)


def test_messages_only(tmp_path: Path) -> None:
    assert flags("record: {frames: never}\n", tmp_path) == [
        Flag("rec", "test.rec", "report"),
        Flag("cid", "140"),
    ]


def test_pictures_until_the_outcome_is_known_at_the_camera_s_rate(tmp_path: Path) -> None:
    camera = "environment: {{camera: {{uses: virtual-camera, with: {{map-path: ../maps/plain, freq: {}}}}}}}\n"
    assert flags(camera.format("25 Hz"), tmp_path)[1:4] == [
        Flag("frames", "25"),
        Flag("pictures", "frames.rec", "report"),
        Flag("memories", "video0.i420:640x480", "memories"),
    ]
    assert flags("record: {rate: 5 Hz}\n" + camera.format("25 Hz"), tmp_path)[1] == Flag("frames", "5")


def test_each_picture_of_a_camera_without_a_rate(tmp_path: Path) -> None:
    replay = "level: dil\nenvironment: {drive: {uses: rec-replay, with: {rec: ../recordings/kiwi.rec}}}\n"
    assert flags(replay, tmp_path)[1] == Flag("frames", "1000")


@pytest.mark.parametrize("record", ["{frames: 2 Hz}", "{frames: always, rate: 2 Hz}"])
def test_pictures_that_stay_are_in_the_recording(tmp_path: Path, record: str) -> None:
    camera = "environment: {camera: {uses: virtual-camera, with: {map-path: ../maps/plain}}}\n"
    assert flags(f"record: {record}\n{camera}", tmp_path)[1:3] == [
        Flag("frames", "2"),
        Flag("memories", "video0.i420:640x480", "memories"),
    ]


def test_frames_of_each_camera(tmp_path: Path) -> None:
    example = """\
record: {frames: 2 Hz}
environment:
  camera: {uses: virtual-camera, with: {map-path: ../maps/plain, width: 320, height: 240}}
  other: {uses: virtual-camera, with: {name.argb: b.argb, name.i420: /b.i420, width: 640, height: 480}}
"""
    assert flags(example, tmp_path)[1:3] == [
        Flag("frames", "2"),
        Flag("memories", "video0.i420:320x240,b.i420:640x480", "memories"),
    ]


def test_a_snapshot_on_a_rig(tmp_path: Path) -> None:
    example = "record: {frames: never}\nlevel: hil\nrig: emulated\nenvironment: {camera: {uses: camera}}\n"
    assert flags(example, tmp_path)[1:3] == [
        Flag("snapshot", "snapshot.png", "report"),
        Flag("memories", "video0.i420:640x480", "memories"),
    ]


def test_no_frames_without_cameras(tmp_path: Path) -> None:
    example = "record: {frames: 2 Hz}\nenvironment: {way: {uses: beacon, with: {length: 3 m}}}\n"
    assert len(flags(example, tmp_path)) == 2
