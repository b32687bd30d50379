"""Which services belong to the stack around an application, and what takes their place."""

from pathlib import Path

import pytest

from tests.application.compiled import Compiled, compiled, repository

_WORLD, _OTHER = "make the world", "records it"
_CASES = {
    "image: registry.opendlv.org/testing/opendlv-vehicle-view-multi:v0.0.60": _OTHER,
    "image: chalmersrevere/opendlv-vehicle-view-multi@sha256:0123": _OTHER,
    "image: '${REGISTRY:-docker.io}/opendlv-video-h264-decoder-amd64:${TAG}'": _OTHER,
    "image: chalmersrevere/opendlv-video-x264-encoder-multi:v0.0.1": _OTHER,
    "image: opendlv-data-replay-video-h264": _WORLD,
    "image: chalmersrevere/opendlv-rec-replay-multi:v0.0.3": _WORLD,
    "image: chrberger/cluon:v0.0.140, command: 'cluon-replay --cid=253 --stdout /r.rec'": _WORLD,
    "image: a/b, command: [/usr/bin/cluon-OD4toStdout, --cid=1]": _OTHER,
    "build: {context: 'https://github.com/chalmers-revere/opendlv-sim-camera.git#v1'}": _WORLD,
    "build: https://github.com/chalmers-revere/opendlv-virtual-camera.git": _WORLD,
    "image: ghcr.io/chalmers-revere/opendlv-sim-global": _WORLD,
    "image: opendlv-virtual-space:v0.0.6": _WORLD,
    "image: chalmersrevere/opendlv-virtual-motor-kiwi-amd64": _WORLD,
    "image: chalmersrevere/opendlv-virtual-motor-kiwid1-amd64": _WORLD,
    "image: opendlv-virtual-rangefinder-ultrasonic-srf08-amd64": _WORLD,
    "image: opendlv-virtual-rangefinder-ir-gp2y0a-amd64": _WORLD,
    "image: registry.opendlv.org/community/opendlv-virtual-adc-bbblue:1.0": _WORLD,
    "image: chalmersrevere/opendlv-logic-distance-voltage-multi": _OTHER,
    "image: chalmersrevere/opendlv-device-camera-v4l-multi": _OTHER,
    "image: chalmersrevere/opendlv-device-lidar-hdl32e-multi": _OTHER,
    "image: h264decoder:v0.0.5": _OTHER,
    "image: car/x264-encoder-armhf": _OTHER,
    "build: 'https://git.car.org/opendlv-video-h264-decoder/archive/v0.0.5.tar.gz'": _OTHER,
    "build: './opendlv-video-h264-decoder-0.0.5/'": _OTHER,
    "image: c, command: 'sh -c \"cluon-OD4toStdout --cid=111 > /rec/a.rec\"'": _OTHER,
}


def beside(written: str, folder: Path) -> Compiled:
    root = repository(folder, {"opendlv-video-h264-decoder/ours/x": "", "opendlv-video-h264-decoder-0.0.5/x": ""})
    return compiled(root, f"services:\n  driver: {{image: team/driver, command: --cid=111}}\n  part: {{{written}}}\n")


@pytest.mark.parametrize(("written", "instead"), _CASES.items())
def test_a_service_of_the_stack_is_named_with_what_takes_its_place(written: str, instead: str, tmp_path: Path) -> None:
    (told,) = (told for told in beside(written, tmp_path).told if told.rule == "application-stack")
    assert instead in told.text
    assert told.line == 3


@pytest.mark.parametrize(
    "written",
    [
        "image: chalmersrevere/opendlv-logic-cfsd18-perception-multi",
        "image: team/opendlv-template, command: --cid=111 --name=img",
        "image: c, command: [sh, -c, './drive & cluon-OD4toStdout --cid=111 > a.rec']",
        "build: ./opendlv-video-h264-decoder/ours",
        "image: team/opendlv-template, command: --recorder cluon-OD4toStdout",
        "build: .",
        "image: team/sim-camera, command: 'sh -c \"cluon-OD4toStdout --cid=111 | ./judge\"'",
        "image: chalmersrevere/opendlv-logic-distance-voltage, x-dodo: {out: [opendlv.proxy.DistanceReading]}",
    ],
)
def test_others_are_the_application_s_own(written: str, tmp_path: Path) -> None:
    assert not [told for told in beside(written, tmp_path).told if told.rule == "application-stack"]
