"""dodo new beside a team's compose file: what it leaves out, declares, and takes for the pictures of tests."""

import os
from pathlib import Path

import pytest
import yaml

from dodo_dsl.application.read import as_written
from dodo_dsl.cli.existing_application import declarable, pictures
from tests.emit.readers import run

COMPOSE = """\
version: '3.6'
services:
  video-h264-decoder:
    image: chalmersrevere/opendlv-video-h264-decoder-multi:v0.0.5
    network_mode: host
    ipc: host
    volumes: [/tmp:/tmp]
    command: "--cid=253 --name=img"
  vehicle-view:
    image: chalmersrevere/opendlv-vehicle-view-multi:v0.0.60
    volumes: [~/recordings:/opt/vehicle-view/recordings, /var/run/docker.sock:/var/run/docker.sock]
  steer:
    build: .
    ipc: host
    volumes: [/tmp:/tmp]
    command: "--name=img.i420 --width=1280 --height=720 --verbose"
"""
SOURCE = """\
int main() {
  cluon::OD4Session od4{111};
  // opendlv::proxy::AngleRequest is not sent: od4.send(angle);
  auto onRequest{[](cluon::data::Envelope &&) {}};
  od4.dataTrigger(opendlv::proxy::VoltageReading::ID(), onRequest);
  od4.dataTrigger(opendlv::proxy::GroundSpeedRequest::ID(), onRequest);
  opendlv::proxy::GroundSteeringRequest steering;
  opendlv::proxy::PedalPositionRequest pedal;
  od4.send(steering); od4.send(pedal);
}
"""


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docker-compose.yml").write_text(COMPOSE)
    (tmp_path / "src").mkdir()
    (tmp_path / "src/steer.cpp").write_text(SOURCE)
    return tmp_path


def test_the_deployment_leaves_the_stack_out_and_says_what_sources_say(repository: Path) -> None:
    assert run("new", "--deployment")[0] == 0
    written = (repository / "dodo.yml").read_text()
    assert "    - video-h264-decoder            # virtual-camera, rec-replay" in written
    assert "    - vehicle-view            # dodo run records each test" in written
    requests = "opendlv.proxy.GroundSteeringRequest, opendlv.proxy.PedalPositionRequest"
    assert f"    steer: {{in: [opendlv.proxy.VoltageReading], out: [{requests}], cid: 111}}\n" in written


def test_a_new_test_shows_its_pictures_as_the_application_reads_them(repository: Path) -> None:
    assert run("new", "--deployment")[0] == 0
    code, out, _ = run("new", "sil-first")
    assert (code, "its pictures are those of 'steer': img.i420, 1280x720\n" in out) == (0, True)
    written = (repository / "tests/sil-first/sil-first.dodo.yml").read_text()
    assert "width: 1280, height: 720, freq: 10 Hz, z: 9.5 cm, name.i420: img.i420}" in written
    code, out, err = run("compile", "--check")
    assert (code, err) == (0, ""), out


@pytest.mark.parametrize(
    ("command", "parameters", "size"),
    [
        ("--name=img --width=640 --height=480", {"name.argb": "img"}, (640, 480)),
        ("--cid=1 --name=video0.argb", {}, (640, 480)),
        ("--name.i420=a.i420 --width=320 --height=240", {"name.i420": "a.i420"}, (320, 240)),
        ("--name=video0.bgr", {"name.bgr": "video0.bgr"}, (640, 480)),
        ("--cid=1", {}, (640, 480)),
    ],
)
def test_pictures(command: str, parameters: dict[str, str], size: tuple[int, int], tmp_path: Path) -> None:
    file = tmp_path / "docker-compose.yml"
    file.write_text(f"services: {{steer: {{image: team/steer, command: '{command}'}}}}")
    found = pictures(as_written(file))
    assert (found.parameters("virtual-camera"), (found.width, found.height)) == (parameters, size)


ALL = "command: --cid=111, x-dodo: {out: [opendlv.proxy.GroundSteeringRequest, opendlv.proxy.PedalPositionRequest]}"
RESPONDER = """\
cluon::OD4Session od4{112, [](cluon::data::Envelope &&e) {
  if (e.dataType() == opendlv::proxy::GroundSteeringRequest::ID()) {
    auto heard = cluon::extractMessage<opendlv::proxy::PedalPositionRequest>(std::move(e));
    od4.send(answer); } }};
"""


@pytest.mark.parametrize(
    ("services", "left_out"),
    [
        ("view: {image: opendlv-vehicle-view}, dec: {image: 'h264decoder:v1'}", ["view", "dec"]),
        (f"a: {{image: a, {ALL}}}, b: {{image: b, command: --cid=112}}, v: {{image: opendlv-ui-x}}", ["v", "b"]),
        (f"a: {{image: a, {ALL}}}, b: {{build: src, environment: {{CID: 112}}}}", ["b"]),
        (f"a: {{image: a, {ALL}}}, b: {{build: src}}", ["b"]),
        ("b: {build: src}", []),
        (f"a: {{image: a, {ALL}}}, log: {{image: c, command: sh -c 'cluon-OD4toStdout --cid=9 > x'}}", ["log"]),
    ],
)
def test_what_is_written_beside_a_compose_file_compiles(repository: Path, services: str, left_out: list[str]) -> None:
    (repository / "docker-compose.yml").write_text(f"services: {{{services}}}\n")
    (repository / "src/steer.cpp").write_text(RESPONDER)
    assert run("new", "--deployment")[0] == 0
    deployment = yaml.safe_load((repository / "dodo.yml").read_text())
    has_own = len(left_out) <= services.count("image:") + services.count("build:") - 1
    assert ("application" in deployment) == has_own
    assert not has_own or deployment["application"].get("without", []) == left_out
    assert run("new", "sil-first")[0] == 0
    assert run("compile", "--check")[:2] == (0, "1 test checked: no problems\n")


def test_a_compose_file_that_says_all_is_named_alone(tmp_path: Path) -> None:
    file = tmp_path / "docker-compose.yml"
    file.write_text("services: {steer: {build: ., command: --cid=1, x-dodo: {out: [opendlv.proxy.AngleRequest]}}}")
    (tmp_path / "steer.py").write_text("session.send(opendlv_proxy_AngleRequest())")
    assert declarable(file) is None


def test_sources_that_cannot_be_read_say_nothing(repository: Path) -> None:
    os.mkfifo(repository / "src/a.cpp")
    (repository / "src/b.cpp").symlink_to(repository / "gone")
    (repository / "src/c.cpp").write_text("/* " * 60_000)  # a comment that may begin at each of them, without an end
    assert run("new", "--deployment")[0] == 0
    assert "GroundSteeringRequest" in (repository / "dodo.yml").read_text()
