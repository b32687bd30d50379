"""The application's compose file: what is rewritten, what is left, and what is refused."""

from pathlib import Path

import pytest

from dodo_dsl.application import opendlv_flags
from dodo_dsl.application.read import read_application
from dodo_dsl.plan.model import Application
from dodo_dsl.plan.rewrite.rewrite import plan_application

COMPOSE = """\
version: "3.6"
services:
  perception:
    build: .
    container_name: perception
    network_mode: "host"
    ipc: "host"
    restart: always
    volumes:
      - /tmp:/tmp
      - ./weights:/weights:ro
    command: "--cid=111 --name=video0.argb --threshold=${THRESHOLD:-3}"
    x-dodo-process: [python, perception.py]
    x-dodo: {in: [], out: [opendlv.logic.perception.DetectionType]}
  steering:
    image: registry.example.org/team/steering:latest
    network_mode: host
    environment:
      - OD4SESSION_CID=111
      - GAIN=2
    depends_on: [perception]
    ports: ["8081:8081"]
"""


def planned(tmp_path: Path, text: str = COMPOSE, isolation: str = "network") -> Application:
    folder = tmp_path / "team"
    folder.mkdir()
    (folder / "docker-compose.yml").write_text(text)
    (folder / "perception.py").touch()
    source, problems = read_application(folder / "docker-compose.yml")
    assert problems == []
    assert source is not None
    return plan_application(source, 140, isolation, tmp_path / "generated" / "my-test", ("track",))


def test_own_network(tmp_path: Path) -> None:
    application = planned(tmp_path)
    waits = {"sandbox": {"condition": "service_started"}, "track": {"condition": "service_healthy"}}
    assert application.folder == "../../team"
    assert application.compose == {
        "services": {
            "perception": {
                "build": "../../team",
                "image": "${DODO_IMAGE_PERCEPTION:-}",
                "ipc": "service:sandbox",
                "volumes": ["tmp:/tmp:nocopy", "../../team/weights:/weights:ro"],
                "command": "--cid=140 --name=video0.argb --threshold=${THRESHOLD:-3}",
                "depends_on": waits,
            },
            "steering": {
                "image": "${DODO_IMAGE_STEERING:-registry.example.org/team/steering:latest}",
                "environment": ["OD4SESSION_CID=140", "GAIN=2"],
                "depends_on": {"perception": {"condition": "service_started"}, **waits},
                "ipc": "service:sandbox",
            },
        }
    }
    assert "perception: --cid=140" in application.changes
    assert "steering: OD4SESSION_CID=140" in application.changes
    assert "steering: ports removed, tests publish none" in application.changes


def test_host_network_keeps_what_is_host(tmp_path: Path) -> None:
    perception = planned(tmp_path, isolation="host").compose["services"]["perception"]
    assert perception["network_mode"] == "host"
    assert perception["ipc"] == "host"
    assert "/tmp:/tmp" in perception["volumes"]
    assert perception["depends_on"] == {"track": {"condition": "service_healthy"}}


def test_processes(tmp_path: Path) -> None:
    perception, steering = planned(tmp_path).services
    assert perception.process == ("python", "perception.py")
    assert perception.command == ("--cid=140", "--name=video0.argb", "--threshold=${THRESHOLD:-3}")
    assert (perception.takes_cid, perception.takes_memory) == (True, True)
    assert steering.process is None
    assert (steering.takes_cid, steering.takes_memory) == (True, False)
    assert steering.environment == {"OD4SESSION_CID": "140", "GAIN": "2"}


REFUSED = {
    "": "application-file",
    "services: {}\n": "missing-key",
    "a: 1\n": "missing-key",
    "- a\n": "wrong-type",
    "services: {a: 3}\n": "wrong-type",
    'services: {a: {command: "--cid=1 \'open"}}\n': "application-file",
    "services: {a: {command: {cid: 1}}}\n": "wrong-type",
    "services: {a: {command: --cid=1, environment: 3}}\n": "wrong-type",
    "services: {a: {command: --cid=1, depends_on: b}}\n": "wrong-type",
    "services: {a: {command: --cid=1, volumes: {a: b}}}\n": "wrong-type",
    "services: {a: {command: --cid=1, x-dodo-process: python x.py}}\n": "wrong-type",
    "services: {a: {command: --cid=1, x-dodo: {inn: []}}}\n": "unknown-key",
    "services: {a: {command: --cid=1, x-dodo-proces: [a]}}\n": "unknown-key",
    "services: {../a: {command: --cid=1}}\n": "wrong-value",
    "services: {sandbox: {command: --cid=1}}\n": "application-file",
    "services: {a: {image: x}}\n": "application-cid",
    "services: {a: {image: x}, a: {image: y}}\n": "duplicate-key",
}


@pytest.mark.parametrize("text", REFUSED)
def test_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "docker-compose.yml").write_text(text)
    _, problems = read_application(tmp_path / "docker-compose.yml")
    assert REFUSED[text] in [p.rule for p in problems]


def test_flags_in_words() -> None:
    words = ("--cid", "111", "--cid=3", "--name=/video0.argb", "--name.i420=video0.i420", "--named=x", "cid=4")
    assert opendlv_flags.with_cid(words, 150) == ("--cid", "150", "--cid=150", *words[3:])
    assert opendlv_flags.with_memory_prefix(words, "p-")[3:] == (
        "--name=/p-video0.argb",
        "--name.i420=p-video0.i420",
        *words[5:],
    )
    shell = ("sh", "-c", "run --cid=111 --verbose")
    assert opendlv_flags.with_cid(shell, 150) == ("sh", "-c", "run --cid=150 --verbose")
