"""Problems of an application as a whole."""

from pathlib import Path

import pytest

from dodo_dsl.application import stack
from tests.application.applications import FIRST, problems


def messages(services: str, folder: Path = Path("/x")) -> list[str]:
    return [problem.message for problem in problems(f"services: {{{services}}}\n", folder)]


def test_a_good_one() -> None:
    assert messages("a: {image: x, command: --cid=111}, b: {image: y, depends_on: [a]}") == []


def test_no_service_starts() -> None:
    (problem,) = problems("services: {}\n")
    assert (problem.span, problem.rule) == (FIRST, "application-file")
    assert problem.message == "no service starts, because each one has a profile or is scaled to 0"


def test_missing_files(tmp_path: Path) -> None:
    (tmp_path / "here.env").touch()
    service = "image: x, command: --cid=1, env_file: [here.env, gone.env, '$A.env', {path: b.env, required: false}]"
    assert messages(f"a: {{{service}}}", tmp_path) == ["there is no file 'gone.env'"]


@pytest.mark.parametrize(
    ("process", "expected"),
    [
        ("[python, drive.py]", ["there is no file 'drive.py' for python to run"]),
        ("[python, here.py]", []),
        ("[python, -m, drive]", []),
        ("[python, $A]", []),
        ("[./drive]", ["there is no program './drive'"]),
        ("[build/drive, drive.py]", ["there is no program 'build/drive'"]),
        ("[build/drive], build: .", []),
        ("[./there], build: .", ["there is no program './there'"]),
        ("[python here.py]", ["there is no program 'python here.py', which is one word"]),
        ("[here.py]", ["there is no program 'here.py' in the PATH"]),
        ("[drive.py]", []),
        ("[pyhton, here.py]", ["there is no program 'pyhton'"]),
        ("[rosrun, here.py]", []),
        ("[./here.py]", ["'./here.py' is not executable"]),
        ("[./there]", ["there is no program './there'"]),
        ("[./three]", []),
    ],
)
def test_missing_programs(process: str, expected: list[str], tmp_path: Path) -> None:
    (tmp_path / "here.py").touch()
    (tmp_path / "three").touch(0o755)
    service = f"a: {{image: x, command: --cid=1, x-dodo-process: {process}}}"
    assert messages(service, tmp_path) == expected


@pytest.mark.parametrize(
    ("build", "missing"),
    [
        (".", ""),
        ("away", "away"),
        ("{context: ./away}", "./away"),
        ("{dockerfile: Dockerfile}", ""),
        ('"${FOLDER:-away}"', ""),
    ],
)
def test_missing_folders_to_build_from(build: str, missing: str, tmp_path: Path) -> None:
    found = messages(f"a: {{command: --cid=1, build: {build}}}", tmp_path)
    assert found == ([f"there is no folder '{missing}'"] if missing else [])


def test_a_cycle() -> None:
    cycle = "a: {image: x, depends_on: [b]}, b: {image: x, links: [c]}, c: {image: x, network_mode: 'service:a'}"
    (message,) = messages(f"{cycle}, d: {{image: x, depends_on: [a]}}, e: {{image: x, command: --cid=1}}")
    assert message == "services depend on one another: a, b, c"


def test_two_services_with_one_variable() -> None:
    services = "a.b: {image: x, command: --cid=1}, a-b: {image: y}"
    assert messages(services) == ["'a-b' and 'a.b' would both take their image from DODO_IMAGE_A_B"]


@pytest.mark.parametrize(
    ("service", "takes_cid"),
    [
        ("command: prog", False),
        ("command: prog --cid=111", True),
        ("entrypoint: [prog, --cid, '1']", True),
        ("environment: [OD4SESSION_CID=111]", True),
        ("environment: {ARGUMENTS: --cid=3}", True),
        ("environment: {OTHER: 1}", False),
    ],
)
def test_a_cid_that_can_be_set(service: str, takes_cid: bool) -> None:
    found = problems(f"services: {{a: {{image: x, {service}}}}}\n")
    assert [(p.rule, p.severity) for p in found] == ([] if takes_cid else [("application-cid", "warning")])


CIDS = (
    ("command: --cid=112", "own"),
    ("command: prog --cid 112", "own"),
    ("command: [--cid, '112']", "own"),
    (r"""entrypoint: [sh, -c, 'exec prog --cid=\"112\" | tee log']""", "own"),
    ("command: '--cid=${CID:-112}'", "own"),
    ("command: [sh, -c, 'prog --cid=$${NUMBER:-111}'], environment: [NUMBER=112]", "own"),
    ("environment: {CID: 112}", "own"),
    ("environment: [OD4SESSION_CID=112]", "own"),
    ("environment: {FLAGS: --cid=112 --freq=10}", "own"),
    ("env_file: b.env", "own"),
    ("command: [--cid=9999999999999999999999], environment: {CID: '112'}", "own"),
    ("env_file: [{path: b.env, format: raw}]", "own"),
    ("x-dodo-process: [./prog, --cid=112]", "own"),
    ("x-dodo: {cid: 112}", "own"),
    ("command: --cid=111 --cid-to=112", "bridge"),
    ("command: --cid=112, environment: {CID: 111}", "bridge"),
    ("command: --cid=0111", ""),
    ("command: '--cid=${CID}'", ""),
    ("command: '--cid=${CID:-111}', environment: {OTHER_CIDS: 112}", ""),
    ("command: --freq=112", ""),
    ("image: opendlv-vehicle-view, command: --cid=112", "stack"),
    ('command: sh -c "cluon-OD4toStdout --cid=112 > log"', "stack"),
)
"""Services beside one on CID 111: on a bus of their own, on both, or neither."""


@pytest.mark.parametrize(("service", "kind"), CIDS)
def test_a_test_has_one_bus(tmp_path: Path, service: str, kind: str) -> None:
    (tmp_path / "b.env").write_text("# the other car's\nOD4SESSION_CID=112\n")
    image = "" if "image" in service else "image: y, "
    found = problems(f"services: {{a: {{image: x, command: --cid=111}}, b: {{{image}{service}}}}}\n", tmp_path)
    told = [(p.severity, p.message.partition(" in ")[0]) for p in found if p.rule in ("application-cid", stack.RULE)]
    expected = {
        "own": [("error", "'b' is on CID 112, and 'a' is on CID 111")],
        "bridge": [("warning", "'b' is on CID 111 and 112, which are one bus")],
        "": [],
    }
    assert told == expected[kind] if kind in expected else [p.rule for p in found] == [stack.RULE]


def test_what_is_on_both_buses_joins_them() -> None:
    on = {"a": "--cid=111", "relay": "--cid-from=112 --cid-to=111", "b": "--cid=112", "c": "--cid=113"}
    found = messages(", ".join(f"{name}: {{image: x, command: {words}}}" for name, words in on.items()))
    assert [message.partition(",")[0] for message in found] == ["'relay' is on CID 111 and 112", "'c' is on CID 113"]


@pytest.mark.parametrize(
    ("volumes", "lacks"),
    [
        ("/tmp:/tmp, /dev/shm:/dev/shm, /dev/video0:/dev/video0, /sys:/sys:ro, /tmp/.X11-unix:/tmp/.X11-unix", ""),
        ("/tmp:/tmp, './config:/opt/config:ro', data:/data", "/opt/config"),
        ("'.:/app'", ""),
        ("{type: bind, source: ./models, target: /models}", "/models"),
    ],
)
def test_volumes_that_a_process_lacks(volumes: str, lacks: str) -> None:
    service = f"a: {{image: x, command: --cid=1, volumes: [{volumes}], x-dodo-process: [python, -m, x]}}"
    found = [message for message in messages(service) if "containers only" in message]
    assert found == [f"the process of 'a' has no '{lacks}', as volumes are mounted in containers only"] * bool(lacks)
    assert not [m for m in messages(service.replace(", x-dodo-process: [python, -m, x]", "")) if "containers only" in m]
