"""Paths of a compose file as seen from another folder."""

import pytest

from dodo_dsl.application.compose_paths import (
    escaped,
    escaped_values,
    is_path,
    mapped_rest,
    mapped_service,
    rebased,
    unescaped,
)
from dodo_dsl.source import plain
from tests.source.nodes import mapping


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("./a", "../team/a"),
        ("a/../b", "../team/b"),
        (".", "../team"),
        ("../x", "../x"),
        ("/abs", "/abs"),
        ("~/home", "~/home"),
        ("${PWD}/map", "../team/map"),
        ("$PWD", "../team"),
        ("$PWDS/map", "$PWDS/map"),
        ("${HOME}/x", "${HOME}/x"),
        ("${A:-./b}/c", "${A:-../team/b}/c"),
        ("./x/${A:-a/../b}", "../team/x/${A:-a/../b}"),
        ("https://example.org/x.git#v1:sub", "https://example.org/x.git#v1:sub"),
        ("git@example.org:x.git", "git@example.org:x.git"),
        ("docker-image://alpine", "docker-image://alpine"),
    ],
)
def test_paths_from_another_folder(path: str, expected: str) -> None:
    assert rebased(path, "../team") == expected


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("build: .", {"build": "<.>"}),
        ("build: {dockerfile: D}", {"build": {"context": "<.>", "dockerfile": "D"}}),
        ("build: {context: a}", {"build": {"context": "<a>"}}),
        (
            "build: {context: a, additional_contexts: [b=c]}",
            {"build": {"context": "<a>", "additional_contexts": ["b=<c>"]}},
        ),
        ("env_file: [a, {path: b, required: false}]", {"env_file": ["<a>", {"path": "<b>", "required": False}]}),
        ("env_file: '${CAR:-kiwi}.env'", {"env_file": "<./${CAR:-kiwi}.env>"}),
        ("volumes: [./a:/b:ro, name:/c, /d]", {"volumes": ["<./a>:/b:ro", "name:/c", "/d"]}),
        ("volumes: [{type: bind, source: a}]", {"volumes": [{"type": "bind", "source": "<a>"}]}),
        ("volumes: [{type: volume, source: a}]", {"volumes": [{"type": "volume", "source": "a"}]}),
        ("security_opt: ['seccomp:p.json']", {"security_opt": ["seccomp:<p.json>"]}),
        ("security_opt: ['seccomp:unconfined']", {"security_opt": ["seccomp:unconfined"]}),
        ("command: ./a", {"command": "./a"}),
    ],
)
def test_paths_of_a_service(written: str, expected: object) -> None:
    assert plain(mapped_service(mapping(written), lambda path: f"<{path}>")) == expected


def test_a_mount_whose_path_has_a_colon_takes_the_long_form() -> None:
    """The short form would be split there; what else it says stays."""
    moved = mapped_service(mapping("volumes: ['./a:/b:ro,z', '.:/c']"), lambda path: rebased(path, escaped("../x:$y")))
    bind = {"create_host_path": False}
    assert plain(moved)["volumes"] == [
        {"type": "bind", "source": "../x:$$y/a", "target": "/b", "read_only": True, "bind": {**bind, "selinux": "z"}},
        {"type": "bind", "source": "../x:$$y/.", "target": "/c", "read_only": False, "bind": bind},
    ]


def test_what_compose_shows_has_two_dollar_signs_for_each() -> None:
    shown = {"volumes": [{"source": "/a$$b", "read_only": True}]}
    assert unescaped(shown) == {"volumes": [{"source": "/a$b", "read_only": True}]}
    assert escaped_values(unescaped(shown)) == shown


def test_paths_at_the_top_level() -> None:
    document = mapping(
        "secrets: {s: {file: a}}\n"
        "volumes: {v: {driver_opts: {o: bind, device: b}}, w: {driver_opts: {o: size=1m, device: c}}}\n"
        "networks: {n: {file: d}}\n"
    )
    rest = mapped_rest({key: entry.value for key, entry in document.entries.items()}, lambda path: f"<{path}>")
    assert {key: plain(value) for key, value in rest.items()} == {
        "secrets": {"s": {"file": "<a>"}},
        "volumes": {
            "v": {"driver_opts": {"o": "bind", "device": "<b>"}},
            "w": {"driver_opts": {"o": "size=1m", "device": "c"}},
        },
        "networks": {"n": {"file": "d"}},
    }


@pytest.mark.parametrize(
    ("options", "device", "moved"),
    [
        ("bind", "b", True),
        ("rbind,ro", "b", True),
        (" bind, ro", "./b", True),
        ("${O:-bind}", "b", True),
        ("ro,${O-rbind}", "./b", True),
        ("${O}", "./b", True),
        ("${O:-size=1m}", "tmpfs", False),
        ("size=1m", "tmpfs", False),
        ("addr=bindings", "./b", False),
    ],
)
def test_devices_of_volumes_that_may_be_folders(options: str, device: str, moved: bool) -> None:
    volumes = mapping(f"v: {{driver_opts: {{o: '{options}', device: {device}}}}}")
    rest = mapped_rest({"volumes": volumes}, lambda path: f"<{path}>")
    assert plain(rest["volumes"])["v"]["driver_opts"]["device"] == (f"<{device}>" if moved else device)


def test_paths_and_names_of_volumes() -> None:
    assert all(map(is_path, ("./a", "../a", "/a", "~/a", "$A")))
    assert not is_path("name")
