"""Two files or services as one, by the rules of compose."""

from typing import Any

import pytest

from dodo_dsl.application.compose_merge import merged, merged_service, settled
from dodo_dsl.source import plain
from tests.source.nodes import mapping


@pytest.mark.parametrize(
    ("base", "over", "expected"),
    [
        ("image: a", "image: b", {"image": "b"}),
        ("image: a", "image:", {"image": "a"}),
        ("image: a", "build: .", {"image": "a", "build": "."}),
        ("command: [a, b]", "command: [c]", {"command": ["c"]}),
        ("environment: {A: 1, B: 2}", "environment: [B=3, C]", {"environment": {"A": 1, "B": "3", "C": None}}),
        ("volumes: [a:/x, b:/y]", "volumes: [c:/x]", {"volumes": ["c:/x", "b:/y"]}),
        (
            "volumes: ['${A:-b:c}:/x']",
            "volumes: [{source: d, target: /x}]",
            {"volumes": [{"source": "d", "target": "/x"}]},
        ),
        ("ports: ['1:1']", "ports: ['1:1', '2:2']", {"ports": ["1:1", "2:2"]}),
        ("dns: a", "dns: [b]", {"dns": ["a", "b"]}),
        (
            "depends_on: [a]",
            "depends_on: {b: {condition: x}}",
            {"depends_on": {"a": {"condition": "service_started"}, "b": {"condition": "x"}}},
        ),
        ("networks: [a]", "networks: {b: {aliases: [c]}}", {"networks": {"a": None, "b": {"aliases": ["c"]}}}),
        ("extra_hosts: {a: '1'}", "extra_hosts: ['a:2']", {"extra_hosts": ["a:1", "a:2"]}),
        ("build: .", "build: {args: {A: 1}}", {"build": {"context": ".", "args": {"A": 1}}}),
        ("logging: {driver: a, options: {x: 1}}", "logging: {driver: b}", {"logging": {"driver": "b"}}),
        ("logging: {driver: a}", "logging: {options: {x: 1}}", {"logging": {"driver": "a", "options": {"x": 1}}}),
        ("x-own: [1]", "x-own: [1, 2]", {"x-own": [1, 1, 2]}),
        ("ports: ['1:1']", "ports: !reset []", {}),
        ("ports: ['1:1']", "ports: !override ['2:2']", {"ports": ["2:2"]}),
    ],
)
def test_services(base: str, over: str, expected: dict[str, Any]) -> None:
    assert plain(settled(merged_service(mapping(base), mapping(over)))) == expected


def test_files() -> None:
    base = "services: {a: {image: x, volumes: [p:/v]}}\nvolumes: {p: {driver: local}}"
    over = "services: {a: {volumes: [q:/v]}, b: {image: y}}\nvolumes: {p: {driver: other}, q: }"
    assert plain(merged(mapping(base), mapping(over))) == {
        "services": {"a": {"image": "x", "volumes": ["q:/v"]}, "b": {"image": "y"}},
        "volumes": {"p": {"driver": "other"}, "q": None},
    }


def test_a_file_by_itself() -> None:
    written = "services: {a: {ports: !reset [], command: !override [x], volumes: [!reset a, b]}}"
    node = settled(mapping(written))
    assert plain(node) == {"services": {"a": {"command": ["x"], "volumes": ["b"]}}}
