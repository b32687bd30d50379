"""The application's compose file in a test: what is rewritten, and what stays."""

from pathlib import Path

from dodo_dsl.application.read import read_application
from dodo_dsl.plan.model import Application, Line
from dodo_dsl.plan.rewrite.rewrite import plan_application
from dodo_dsl.plan.rewrite.service_copy import Setting
from tests.plan.rewrite.copies import CONFINED

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


def planned(tmp_path: Path, text: str = COMPOSE, isolation: str = "network", seed: int | None = None) -> Application:
    folder = tmp_path / "team"
    folder.mkdir()
    (folder / "docker-compose.yml").write_text(text)
    (folder / "perception.py").touch()
    source, problems = read_application(folder / "docker-compose.yml")
    assert [problem.message.partition(",")[0] for problem in problems] == [
        f"the process of '{name}' has no '{target}'"
        for name, target in [("perception", "/weights")]
        if "./weights" in text and "x-dodo-process" in text
    ]
    assert source is not None
    folder = tmp_path / "generated" / "my-test"
    return plan_application(source, Setting(140, isolation, folder, ("track",), time_seed=seed))


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
                **CONFINED,
            },
            "steering": {
                "image": "${DODO_IMAGE_STEERING:-registry.example.org/team/steering:latest}",
                "environment": ["OD4SESSION_CID=140", "GAIN=2"],
                "depends_on": {"perception": {"condition": "service_started"}, **waits},
                "ipc": "service:sandbox",
                **CONFINED,
            },
        }
    }
    added = "cap_drop, ipc, logging, mem_limit, pids_limit, security_opt, ulimits"
    assert application.changes == (
        "perception: command: --cid=140",
        "perception: image from DODO_IMAGE_PERCEPTION, where it is set",
        "perception: container_name removed, compose names the container",
        "perception: restart removed, containers are not restarted",
        "perception: ipc is the test's own",
        "perception: volumes: /tmp is the test's own",
        "perception: paths start at this folder: build, volumes",
        f"perception: added for the test: {added.replace('ipc, ', 'depends_on, ')}",
        "perception: left out: x-dodo, x-dodo-process",
        "steering: environment: OD4SESSION_CID=140",
        "steering: image from DODO_IMAGE_STEERING, where it is set",
        "steering: ports removed, tests publish none",
        "steering: changed for the test: depends_on",
        f"steering: added for the test: {added}",
        "all services: network_mode removed, the test has its own network",
        "left out: version",
    )


def test_host_network_keeps_what_is_host(tmp_path: Path) -> None:
    perception = planned(tmp_path, isolation="host").compose["services"]["perception"]
    assert perception["network_mode"] == "host"
    assert perception["ipc"] == "host"
    assert "/tmp:/tmp" in perception["volumes"]
    assert perception["depends_on"] == {"track": {"condition": "service_healthy"}}


def test_its_time_is_the_test_s(tmp_path: Path) -> None:
    """Also where variables are a list; what the file sets itself stays."""
    text = COMPOSE.replace("- GAIN=2", "- GAIN=2\n      - OMP_NUM_THREADS=4\n      - LD_PRELOAD=/own.so")
    services = planned(tmp_path, text, seed=7).compose["services"]
    mount = {"type": "volume", "source": "dodo-time", "target": "/opt/dodo/time", "read_only": True}
    for number, name in enumerate(("perception", "steering")):
        assert services[name]["pid"] == "service:sandbox"
        assert services[name]["volumes"][-1] == mount
        variables = services[name]["environment"]
        pairs = dict(item.split("=", 1) for item in variables) if isinstance(variables, list) else variables
        assert pairs["DODO_TIME_SERVICE"] == str(number)
        assert pairs["DODO_TIME"] == "/dev/shm/dodo-time"
        assert pairs["PYTHONHASHSEED"] == "7"
    assert services["perception"]["environment"]["LD_PRELOAD"] == "/opt/dodo/time/libdodo-time.so"
    assert "LD_PRELOAD=/opt/dodo/time/libdodo-time.so:/own.so" in services["steering"]["environment"]
    assert "OMP_NUM_THREADS=4" in services["steering"]["environment"]


def test_processes(tmp_path: Path) -> None:
    perception, steering = planned(tmp_path).services
    assert perception.process == ("python", "perception.py")
    assert perception.command == ("--cid=140", "--name=video0.argb", "--threshold=${THRESHOLD:-3}")
    assert (perception.takes_cid, perception.takes_memory) == (True, True)
    assert steering.process is None
    assert (steering.takes_cid, steering.takes_memory) == (True, False)
    assert steering.environment == {"OD4SESSION_CID": "140", "GAIN": "2"}


def test_keys_without_a_value_are_left_out(tmp_path: Path) -> None:
    build = "{context: ., target: , args: {A: }}"
    text = f"services: {{a: {{image: a, command: --cid=111, environment: , env_file: , platform: , build: {build}}}}}"
    service = planned(tmp_path, text).compose["services"]["a"]
    assert not {"environment", "env_file", "platform"} & set(service)
    assert service["build"] == {"context": "../../team", "args": {"A": None}}


def test_what_starts_before_a_service(tmp_path: Path) -> None:
    """By the conditions of ``depends_on``, and where it joins another one."""
    text = """\
services:
  a: {image: a, command: --cid=111, depends_on: [b], network_mode: "service:c", links: ["d:x"]}
  b: {image: a, depends_on: {c: {condition: service_healthy, required: false}, gone: {condition: service_started}}}
  c: {image: a, depends_on: {d: {condition: service_completed_successfully}}}
  d: {image: a, depends_on: {e: {condition: "${HOW}"}}}
  e: {image: a}
  gone: {image: a, profiles: [view]}
"""
    started = "service_started"
    services = planned(tmp_path, text).services
    assert {service.name: service.optional for service in services if service.optional} == {"b": ("c",)}
    assert {service.name: service.after for service in services} == {
        "a": {"c": started, "d": started, "b": started},
        "b": {"c": "service_healthy"},
        "c": {"d": "service_completed_successfully"},
        "d": {"e": started},
        "e": {},
    }


def test_what_prints_messages_has_a_terminal(tmp_path: Path) -> None:
    lines = "[{match: '(?P<position>.)$', message: opendlv.proxy.PedalPositionRequest, sender: 2}]"
    text = f"""services:
  a: {{image: a, command: --cid=111, tty: false, x-dodo: {{lines: {lines}}}}}
  b: {{image: b, x-dodo: {{out: []}}}}
"""
    application = planned(tmp_path, text)
    assert [service.get("tty") for service in application.compose["services"].values()] == [True, None]
    assert "a: tty: true, as programs print each line at once to a terminal" in application.changes
    line = Line("(?P<position>.)$", "opendlv.proxy.PedalPositionRequest", 2)
    assert [service.lines for service in application.services] == [(line,), ()]
