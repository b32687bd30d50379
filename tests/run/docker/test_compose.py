"""What ``docker compose`` gets of a test: the application of the plan, in which tests are hidden."""

import asyncio
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.plan.model import ApplicationService, Plan
from dodo_dsl.run.docker.compose import Compose
from dodo_dsl.run.docker.pulls import Pulls
from dodo_dsl.run.protocol import BackendError
from tests.run.scripted import plan

HIDDEN = {"tests/map.json": "tests", ".git/config": ".git", "a.dodo.yml": "a.dodo.yml"}
BUILD = {"context": "../..", "args": {"A": "$$a"}}


def planned(services: dict[str, Any], **more: Any) -> Plan:
    """A test of a repository, whose folder is ``generated/t`` in it."""
    keys = ("process", "copies")
    named = tuple(ApplicationService(name, more.get("process")) for name in services)
    compose = {"services": services, **{key: value for key, value in more.items() if key not in keys}}
    made = plan("t")
    own = replace(
        made.application, folder="../..", services=named, compose=compose, hidden=("tests", "a.dodo.yml"),
        copies=more.get("copies", {}),
    )  # fmt: skip
    return replace(made, application=own)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a compiled test, and a docker command that does nothing but keep what it builds."""
    for name in (*HIDDEN, "app.py", "generated/t/environment.compose.yml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    program = tmp_path.parent / f"{tmp_path.name}-bin" / "docker"
    program.parent.mkdir()
    program.write_text(
        '#!/bin/sh\ntest "$6" != build || { cp "$5" "$0.json"; cd "$(dirname "$5")"; find . > "$0.files"; }\n'
    )
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}:{os.environ['PATH']}")
    return tmp_path / "generated" / "t"


def read(made: Plan, folder: Path, is_whole: bool = True) -> Compose:
    report = folder.parents[1] / "dodo-report" / "t"
    test = Compose(made, folder, report, "project", lambda _: None, is_whole=is_whole)
    test.read()
    return test


def volumes(*mounts: Any, folder: Path, **more: Any) -> list[Any]:
    document = read(planned({"app": {"volumes": [*mounts]}}, **more), folder).document()
    return list(document["services"]["app"]["volumes"])


def test_where_services_meet_is_hidden(folder: Path) -> None:
    """With those of other tests, also in the host's ``/tmp``, which programs of cars mount."""
    host = folder.parents[1] / "host"
    (host / "channels" / "one").mkdir(parents=True)
    test = read(planned({"app": {"volumes": [f"{host}:/tmp"]}}), folder)
    test.channel = str(host / "channels" / "one")
    mounts = test.document()["services"]["app"]["volumes"]
    assert {"type": "tmpfs", "target": "/tmp/channels", "read_only": True} in mounts


def bind(source: str, target: str, makes: bool = True) -> dict[str, Any]:
    return {"type": "bind", "source": source, "target": target, "bind": {"create_host_path": makes}}


@pytest.mark.parametrize(
    ("mount", "targets"),
    [
        ("../..:/app", ["/app/.git", "/app/a.dodo.yml", "/app/generated", "/app/tests"]),
        (bind("../..", "/app"), ["/app/.git", "/app/a.dodo.yml", "/app/generated", "/app/tests"]),
        ("../../tests:/t:ro", ["/t"]),
        (bind("../../tests/map.json", "/map.json"), ["/map.json"]),
        ("own:/b", []),
        ({"type": "tmpfs", "target": "/b"}, []),
        ("../../gone:/g", ["/g"]),
        (bind("../../gone", "/g", makes=False), []),
    ],
)
def test_what_lies_over_mounts(mount: Any, targets: list[str], folder: Path) -> None:
    """Empty folders, an empty file over a file, and nothing that the engine would make as root."""
    first, *found = volumes(mount, folder=folder, volumes={"own": {}})
    found = [each for each in (first, *found) if each != mount and "bind" not in each]
    assert sorted(mask["target"] for mask in found) == targets
    assert all(mask["read_only"] for mask in found)
    assert {m["target"] for m in found if m["type"] == "bind"} == {t for t in targets if t.endswith("dodo.yml")}


@pytest.mark.parametrize(
    ("services", "more", "said"),
    [
        ({"volumes": ["../../out:/o:ro"]}, {}, "is a symbolic link to '/etc', outside the repository"),
        ({}, {"copies": {"files-0": "../../out"}}, "is a symbolic link to '/etc', outside the repository"),
        ({}, {"configs": {"c": {"file": "../../tests/map.json"}}}, r"configs\.c\.file: .*tests/map.json' lies where"),
        ({"image": "${NOBODY:?says}"}, {}, "NOBODY"),
    ],
)
def test_what_leads_elsewhere_since(services: Any, more: Any, said: str, folder: Path) -> None:
    (folder.parents[1] / "out").symlink_to("/etc")
    with pytest.raises(BackendError, match=said):
        read(planned({"app": services}, **more), folder)


def test_a_docker_command_that_cannot_compose(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = folder / "docker"
    program.write_text("#!/bin/sh\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")
    with pytest.raises(BackendError, match="has no 'compose' of version 2"):
        asyncio.run(read(planned({}), folder).require_plugin())
    monkeypatch.setenv("PATH", str(folder / "nothing"))
    with pytest.raises(BackendError, match="there is no program 'docker'"):
        read(planned({}), folder)


def test_what_the_engine_does_not_see_is_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = folder / "docker"
    program.write_text("#!/bin/sh\necho 'invalid mount: bind source path does not exist: /own/far' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")
    with pytest.raises(BackendError, match="does not see '/own/far' of this machine: work in a folder that it has"):
        asyncio.run(read(planned({"a": {"image": "a"}}), folder).create(["10.0.0.0/28"]))


def test_a_run_builds_from_a_copy_and_replaces_no_image(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The image has a name of its own for all that use it; one that a pipeline has built is pulled."""
    pulled: list[set[str]] = []

    async def provide(_: object, plan: Plan, own: set[str], foreign: set[str], *__: object) -> list[str]:
        pulled.append(foreign)
        return []

    monkeypatch.setattr(Pulls, "provide", provide)
    monkeypatch.setenv("DODO_IMAGE_P", f"p@sha256:{'0' * 64}")
    services = {
        "a": {"image": "${DODO_IMAGE_A:-postgres}", "build": BUILD},
        "b": {"image": "postgres"},
        "c": {"image": "", "build": {"context": "https://example.org/a.git"}},
        "d": {"image": "c"},
        "p": {"image": "${DODO_IMAGE_P:-p}", "build": BUILD},
    }
    test = read(planned(services), folder)
    asyncio.run(test.provide_images(Pulls(None)))
    made = {name: service["image"] for name, service in test.document()["services"].items() if name in services}
    assert made["a"] == made["b"] != made["c"]
    assert pulled == [{"c", f"p@sha256:{'0' * 64}"}]
    program = folder.parents[2] / f"{folder.parents[1].name}-bin" / "docker"
    built = json.loads(Path(f"{program}.json").read_text())["services"]
    assert {name: service["image"] for name, service in built.items()} == {name: made[name] for name in ("a", "c")}
    assert all(image.startswith("dodo-build:") for image in (made["a"], made["c"]))
    assert built["a"]["build"]["args"] == {"A": "$$a"}
    seen = Path(f"{program}.files").read_text()
    assert "/app.py" in seen
    assert not [name for name in ("config", "generated", "map.json", "dodo.yml") if name in seen]
    assert [path.name for path in test.report.iterdir()] == ["logs"]


def test_nothing_waits_for_services_that_are_processes(folder: Path) -> None:
    """Containers that DoDo adds have this machine's programs."""
    on = {"condition": "service_started"}
    services = {"app": {"image": "a", "depends_on": {"track": on, "sandbox": on}}}
    made = planned(services, copies={"files-0": "../../gone"}, volumes={"files-0": {}})
    found = read(made, folder, is_whole=False).document()["services"]
    assert [name for name, service in found.items() if "profiles" not in service] == ["sandbox", "app", "dodo-files"]
    assert "depends_on" not in found["app"]
    assert {"type": "tmpfs", "target": "/from/files-0", "read_only": True} in found["dodo-files"]["volumes"]
    usr = {"source": "/usr", "target": "/usr", "type": "bind", "read_only": True}
    assert all(usr in found[name]["volumes"] for name in ("sandbox", "dodo-files"))
