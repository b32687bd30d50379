"""Applications as a whole: which services start, on which bus, with what; and the files that are read for them."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl import compiler
from dodo_dsl.plan.model import ApplicationService
from tests.application.compiled import FILE, Compiled, compiled, filled, repository

FILES = {"here.py": "", "a.txt": "x", "b.env": "# the other car's\nOD4SESSION_CID=112\n", "data/x": "A=1\n"}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    root = repository(tmp_path, FILES)
    (root / "three").touch(0o755)
    return root


def of_services(root: Path, **services: Any) -> Compiled:
    return compiled(root, {"services": services})


def rules(test: Compiled) -> list[tuple[str, str, int]]:
    return [(told.severity, told.rule, told.line) for told in test.told]


def car(**more: Any) -> dict[str, Any]:
    return {"image": "x", "command": "--cid=111", **more}


HUGE = {
    "a string": {"a": {"image": "x", "command": "--cid={" * 100_000}},
    "many services": {f"s{n}": {"image": "x", "depends_on": [f"s{n + 1}"]} for n in range(3_000)},
    "a chain": {f"s{n}": {"image": "x", "extends": f"s{n + 1}", "environment": [f"A{n}=1"]} for n in range(2_000)},
    "many copies": {
        "s": {"image": "x", "environment": [f"A{n}=1" for n in range(5_000)]},
        **{f"s{n}": {"image": "x", "extends": "s"} for n in range(2_000)},
    },
}


@pytest.mark.parametrize("services", HUGE.values(), ids=HUGE)
@pytest.mark.thorough
def test_what_would_grow_without_end_is_refused(services: dict[str, Any], root: Path) -> None:
    assert "too-large" in {told.rule for told in compiled(root, json.dumps({"services": services})).errors}


def test_services_that_do_not_start(root: Path) -> None:
    off = {"b": {"profiles": ["car", "lab"]}, "c": {"scale": 0}, "d": {"deploy": {"replicas": 0}}}
    waiting = car(depends_on=["b", "c", "e"])
    test = of_services(root, a=waiting, e=car(), **{name: {"image": "x", **why} for name, why in off.items()})
    assert test.told == ()
    assert list(test.services) == ["a", "e"]
    assert not set(test.services["a"]["depends_on"]) & set(off)


@pytest.mark.parametrize(
    ("service", "rule"),
    [
        ({"build": "."}, ""),
        ({"build": {"context": "${FOLDER:-data}"}}, ""),
        ({"env_file": ["gone.env", {"path": "b.txt", "required": False}]}, "application-file"),
    ],
)
def test_what_is_missing(service: dict[str, Any], rule: str, root: Path) -> None:
    """Each at a line of the service; what an image may have is a warning."""
    told = of_services(root, a=car(**service)).told
    assert [one.rule for one in told] == ([rule] if rule else [])
    assert all(2 < one.line < 3 + len(car(**service)) for one in told)


CIDS = (
    ({"command": "--cid=112"}, "own"),
    ({"command": "prog --cid 112"}, "own"),
    ({"command": ["--cid", "112"]}, "own"),
    ({"entrypoint": ["sh", "-c", 'exec prog --cid="112" | tee log']}, "own"),
    ({"command": "--cid=${CID:-112}"}, "own"),
    ({"command": ["sh", "-c", "prog --cid=$${NUMBER:-111}"], "environment": ["NUMBER=112"]}, "own"),
    ({"environment": {"CID": 112}}, "own"),
    ({"environment": {"FLAGS": "--cid=112 --freq=10"}}, "own"),
    ({"env_file": "b.env"}, "own"),
    ({"x-dodo-process": ["./three", "--cid=112"]}, "own"),
    ({"x-dodo": {"cid": 112}}, "own"),
    ({"command": "--cid=111 --cid-to=112"}, "bridge"),
    ({"command": "--cid=112", "environment": {"CID": 111}}, "bridge"),
    ({"command": "--cid=0111"}, ""),
    ({"command": "--cid=${CID}"}, ""),
    ({"command": "--cid=${CID:-111}", "environment": {"OTHER_CIDS": 112}}, ""),
    ({"command": "--freq=112"}, ""),
    ({"image": "opendlv-vehicle-view", "command": "--cid=112"}, "stack"),
    ({"command": 'sh -c "cluon-OD4toStdout --cid=112 > log"'}, "stack"),
)
"""Services beside one on CID 111: on a bus of their own, on both, or neither."""


@pytest.mark.parametrize(("service", "kind"), CIDS)
def test_a_test_has_one_bus(service: dict[str, Any], kind: str, root: Path) -> None:
    test = of_services(root, a=car(), b={"image": "y", **service})
    told = [(one.severity, one.rule) for one in test.told if one.rule in ("application-cid", "application-stack")]
    cid = "application-cid"
    expected = {"own": [("error", cid)], "bridge": [("warning", cid)], "stack": [("warning", "application-stack")]}
    assert told == expected.get(kind, [])


def test_what_is_on_both_buses_joins_them(root: Path) -> None:
    on = {"a": "--cid=111", "relay": "--cid-from=112 --cid-to=111", "b": "--cid=112", "c": "--cid=113"}
    test = of_services(root, **{name: {"image": "x", "command": words} for name, words in on.items()})
    assert [(severity, line) for severity, _, line in rules(test)] == [("warning", 5), ("error", 11)]


@pytest.mark.parametrize(
    ("service", "takes_cid"),
    [
        ({"command": "prog"}, False),
        ({"environment": ["OD4SESSION_CID=111"]}, True),
        ({"environment": {"ARGUMENTS": "--cid=3"}}, True),
        ({"environment": {"OTHER": 1}}, False),
    ],
)
def test_a_cid_that_can_be_set(service: dict[str, Any], takes_cid: bool, root: Path) -> None:
    test = of_services(root, a={"image": "x", **service})
    assert [rule for _, rule, _ in rules(test)] == [] if takes_cid else ["application-cid"]


def planned(test: Compiled) -> dict[str, ApplicationService]:
    assert test.plan is not None, test.told
    return {service.name: service for service in test.plan.application.services}


def test_processes(root: Path) -> None:
    """What a service is without its container, from the same file."""
    lines = [{"match": "(?P<position>.)$$", "message": "opendlv.proxy.PedalPositionRequest", "sender": 2}]
    own = {"in": ["opendlv.proxy.ImageReading"], "out": ["opendlv.proxy.GroundSteeringRequest"], "lines": lines}
    command = "here.py --cid=111 --name=video0.argb"
    one = car(command=command, **{"x-dodo-process": ["python", "here.py"], "x-dodo": own})
    found = planned(of_services(root, a=one, b={"image": "x", "environment": ["OD4SESSION_CID=111", "GAIN=2"]}))
    assert found["a"].process == ("python", "here.py")
    assert found["a"].command == ("--cid=140", "--name=video0.argb")
    assert (found["a"].takes_cid, found["a"].takes_memory) == (True, True)
    assert found["a"].inputs == ("opendlv.proxy.ImageReading",)
    assert set(found["a"].outputs) == {"opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest/2"}
    assert [(line.match, line.sender) for line in found["a"].lines] == [("(?P<position>.)$", 2)]
    assert (found["b"].process, found["b"].environment) == (None, {"OD4SESSION_CID": "140", "GAIN": "2"})


def test_what_starts_before_a_service(root: Path) -> None:
    """By the conditions of ``depends_on``, and where it joins another one."""
    healthy, ended = {"condition": "service_healthy"}, {"condition": "service_completed_successfully"}
    found = planned(
        of_services(
            root,
            a=car(depends_on=["b"], network_mode="service:c", links=["d:x"]),
            b=car(depends_on={"c": {**healthy, "required": False}, "gone": {"condition": "service_started"}}),
            c=car(depends_on={"d": ended}, healthcheck={"test": "x"}),
            d=car(),
            gone=car(profiles=["view"]),
        )
    )
    started = "service_started"
    assert {name: service.after for name, service in found.items()} == {
        "a": {"c": started, "d": started, "b": started},
        "b": {"c": "service_healthy"},
        "c": {"d": "service_completed_successfully"},
        "d": {},
    }
    assert {name: service.optional for name, service in found.items() if service.optional} == {"b": ("c",)}


def test_its_time_is_the_test_s(root: Path) -> None:
    """Also where variables are a list; what the file sets itself stays."""
    own = {"a": car(environment={"A": "1"}), "b": car(environment=["OMP_NUM_THREADS=4", "LD_PRELOAD=/own.so"])}
    test = compiled(root, {"services": own}, settings=compiler.Settings(clock="lockstep", isolation="network"))
    for number, service in enumerate(test.services.values()):
        assert service["pid"] == "service:sandbox"
        assert "dodo-time:/opt/dodo/time:ro" in service["volumes"]
        assert service["environment"]["DODO_TIME_SERVICE"] == str(number)
    assert test.services["b"]["environment"]["LD_PRELOAD"] == "/opt/dodo/time/libdodo-time.so:/own.so"
    assert test.services["b"]["environment"]["OMP_NUM_THREADS"] == "4"


def test_variables_that_a_compiled_file_names(root: Path) -> None:
    """Those that ``dodo.yml`` passes, secrets of ``.env``, and images."""
    (root / ".env").write_text("A=1\nAPI_KEY=s3cr3t\n")
    command = "--cid=111 ${A} ${API_KEY} ${PASSED} ${D:-x}"
    test = compiled(root, {"services": {"a": car(command=command)}}, environment=["PASSED"])
    named = set(re.findall(r"(?<!\$)\$\{?([A-Za-z_]+)", test.files["application.compose.yml"]))
    assert named == {"API_KEY", "PASSED", "DODO_IMAGE_A"}
    assert test.services["a"]["command"] == ["--cid=140", "1", "x"]


def test_a_pipeline_sets_images(root: Path) -> None:
    services = {"my-eyes.v2": car(), "built": {"build": ".", "command": "--cid=111"}}
    text = of_services(root, **services).files["application.compose.yml"]
    given = {"DODO_IMAGE_MY_EYES_V2": "other@sha256:0", "DODO_IMAGE_BUILT": "built:2"}
    for variables, images in (({}, ["x", ""]), (given, ["other@sha256:0", "built:2"])):
        made = filled(yaml.safe_load(text), variables)["services"]
        assert [made[name]["image"] for name in services] == images


def test_what_is_left_out_is_named_once(root: Path) -> None:
    """In one warning a service, at the first of the keys."""
    keys = {"ports": ["80:80"], "restart": "always", "labels": {"a": "b"}, "container_name": "c"}
    test = of_services(root, a=car(**keys), b=car(**keys))
    assert rules(test) == [("warning", "application-key", line) for line in (5, 12)]
    assert not [key for service in test.services.values() for key in keys if key in service]


@pytest.mark.parametrize(
    ("service", "env", "named"),
    [
        ({"command": "--cid=111 --a=${API_KEY} --b=$CI_X"}, "", ["API_KEY", "CI_X"]),
        ({"command": ["--cid=111", "${A:-${API_KEY}}", "${API_KEY}"]}, "", ["API_KEY"]),
        ({"command": "sh -c 'echo --cid=111 $${API_KEY}'"}, "", []),
        ({"environment": ["API_KEY", "SPEED", "A_TOKEN=1"]}, "", ["API_KEY"]),
        ({"environment": {"API_KEY": None, "A_TOKEN": "x"}}, "", ["API_KEY"]),
        ({"build": {"context": ".", "args": ["API_KEY"]}}, "", ["API_KEY"]),
        ({"environment": ["DATABASE", "HOME", "SPEED"]}, "", ["DATABASE", "HOME"]),
        ({"environment": ["PASSED"]}, "", []),
        ({"environment": {"A": "${OWN}"}}, "OWN=1", []),
    ],
)
def test_variables_of_the_host_are_named(
    service: dict[str, Any], env: str, named: list[str], root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a warning each where the application may not have them."""
    for name, value in {"DATABASE": "x://a:s3cr3t@b", "PASSED": "1"}.items():
        monkeypatch.setenv(name, value)
    (root / ".env").write_text(f"{env}\n")
    test = compiled(root, {"services": {"a": car(**service)}}, environment=["PASSED"])
    told = [one for one in test.told if one.rule == "application-secret"]
    assert [one.text.split("'")[1] for one in told] == named
    assert "s3cr3t" not in "".join(one.text for one in told)


@pytest.mark.parametrize("holder", ["tests", ".git", "generated", "dodo-report"])
@pytest.mark.parametrize(
    "document",
    [
        {"services": {"a": car(volumes=["./FOLDER/x:/x:ro"])}},
        {"services": {"a": car(env_file="FOLDER/x")}},
        {"services": {"a": car(build="FOLDER")}},
        {"services": {"a": car(configs=["c"])}, "configs": {"c": {"file": "FOLDER/x"}}},
        {"services": {"a": car(secrets=["c"])}, "secrets": {"c": {"file": "./FOLDER/x"}}},
        {"services": {"a": car(volumes=["./link/x:/x"])}},
    ],
    ids=["volume", "env_file", "build", "config", "secret", "link"],
)
def test_what_no_application_sees(document: dict[str, Any], holder: str, root: Path) -> None:
    (root / holder).mkdir(exist_ok=True)
    (root / holder / "x").write_text("A=1\n")
    (root / "link").symlink_to(holder)
    text = json.dumps(document)
    assert compiled(root, text.replace("FOLDER", holder)).errors
    (root / "link").unlink()
    (root / "link").symlink_to("data")
    assert compiled(root, text.replace("FOLDER", "data")).errors == []


def test_variables_are_read_beside_the_file_that_a_link_means(root: Path) -> None:
    """As compose reads them: a bare name would else take what its caller has."""
    (root / "sub").mkdir()
    (root / "sub" / "vars.env").write_text("HOME\nOD4SESSION_CID=112\n")
    (root / "sub" / FILE).write_text(json.dumps({"services": {"a": {"image": "x", "env_file": "vars.env"}}}))
    (root / FILE).unlink(missing_ok=True)
    (root / FILE).symlink_to(f"sub/{FILE}")
    made = compiled(root).services["a"]["environment"]
    assert made["HOME"] == "" and made["OD4SESSION_CID"] != "112"


SANDBOX = {"cpus": 2.5, "memory": "500 MB", "processes": 100, "files": 50, "file-size": "10 MB"}


@pytest.mark.parametrize(
    ("service", "key", "cut"),
    [
        ({}, "cpus", "2.5"),
        ({"cpus": 1.5}, "cpus", "1.5"),
        ({"cpus": 3}, "cpus", "2.5"),
        ({"cpus": 0}, "cpus", "2.5"),
        ({}, "mem_limit", "500000000"),
        ({"mem_limit": "1g"}, "mem_limit", "500000000"),
        ({"pids_limit": 200}, "pids_limit", "100"),
        ({"tmpfs": "/run"}, "tmpfs", ["/run:size=500000000"]),
        ({"ulimits": {"nofile": 99}}, "ulimits", {"core": "0", "fsize": "10000000", "nofile": "50"}),
    ],
)
def test_limits_of_dodo_yml(service: dict[str, Any], key: str, cut: object, root: Path) -> None:
    assert compiled(root, {"services": {"a": car(**service)}}, sandbox=SANDBOX).services["a"][key] == cut


def test_services_share_a_copy_and_nothing_beside_it(root: Path) -> None:
    services = {
        "a": car(volumes=["./new:/d"]),
        "b": car(volumes=["./new/:/e:ro", "./data/x:/f:ro"]),
        "c": car(volumes=[".:/app"]),
        "d": car(volumes=[".:/b:ro"]),
    }
    test = of_services(root, **services)
    assert [service["volumes"] for service in test.services.values()] == [
        ["files-0:/d:nocopy"],
        ["files-0:/e:nocopy,ro", "./data/x:/f:ro"],
        ["files-1:/app:nocopy"],
        ["files-1:/b:nocopy,ro"],
    ]
    assert set(test.document["volumes"]) == {"files-0", "files-1"}
