"""Compose files as DoDo reads them: which are refused, which services start, and what is not followed."""

import json
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.application.read import read_application

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


def test_services_that_do_not_start(tmp_path: Path) -> None:
    (tmp_path / "docker-compose.yml").write_text(
        "services:\n"
        "  a: {image: x, command: --cid=1, container_name: eyes}\n"
        "  b: {image: x, profiles: [car, lab]}\n"
        "  c: {image: x, scale: 0}\n"
        "  d: {image: x, deploy: {replicas: 0}}\n"
        "volumes: {v: }\n"
    )
    found, problems = read_application(tmp_path / "docker-compose.yml")
    assert found is not None
    assert problems == []
    assert list(found.services) == ["a"]
    assert found.dropped == {"b": "it needs profile car or lab", "c": "it is scaled to 0", "d": "it is scaled to 0"}
    assert found.containers == {"eyes": "a"}
    assert list(found.rest) == ["volumes"]


def test_cid_variables_that_are_interpolated(tmp_path: Path) -> None:
    (tmp_path / "docker-compose.yml").write_text("services: {a: {image: x, command: '--cid=${CID}'}}\n")
    (tmp_path / ".env").write_text("CID=111\nOTHER=1\n")
    found, _ = read_application(tmp_path / "docker-compose.yml")
    assert found is not None
    assert found.variables == {"CID": "", "OTHER": "1"}


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
def test_what_would_grow_without_end_is_refused(services: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / "docker-compose.yml"
    file.write_text(json.dumps({"services": services}))
    found, problems = read_application(file)
    assert found is None
    assert "too-large" in {p.rule for p in problems}


def test_links_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("CID=1\nPASSWORD=hidden\nservices: {a: {image: secret}}\n")
    folder = tmp_path / "team"
    folder.mkdir()
    for name in (".env", "common.yml"):
        (folder / name).symlink_to(tmp_path / "secret")
    file = folder / "docker-compose.yml"
    file.write_text("services: {b: {image: x, command: --cid=1}}\n")
    found, problems = read_application(file)
    assert found is not None and problems == [] and found.variables == {}
    file.write_text("services: {b: {extends: {file: common.yml, service: a}}}\n")
    found, problems = read_application(file)
    assert found is None
    assert [p.message for p in problems] == [
        f"'common.yml' is a symbolic link to '{tmp_path / 'secret'}', outside the repository"
    ]
