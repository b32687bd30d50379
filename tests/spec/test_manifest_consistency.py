"""Manifests that contradict themselves."""

import pytest

from dodo_dsl.spec.manifest import inconsistencies
from tests.source.nodes import mapping

PARAMETERS = [
    ("{type: integer, default: 1.5}", "default"),
    ("{type: number, unit: m, default: true}", "default"),
    ("{type: string, default: [x]}", "default"),
    ("{type: path, default: x}", "default"),
    ("{type: number, default: 5, maximum: 4}", "default"),
    ("{type: string, default: x, choices: [y]}", "default"),
    ("{type: string, unit: m}", "unit"),
    ("{type: boolean, minimum: 1}", "minimum"),
    ("{type: number, choices: [y]}", "choices"),
    ("{type: number, unit: m, within-timeout: true}", "within-timeout"),
    ("{type: number, setup-times: 2}", "setup-times"),
    ("{type: number, minimum: 2, maximum: 1}", "minimum"),
    ("{type: number, of: integer}", "of"),
    ("{type: list, of: number, default: [x]}", "default"),
    ("{type: list, of: number, unit: m, default: [true]}", "default"),
    ("{type: list, unit: m}", "unit"),
    ("{type: list, per: map}", "per"),
    ("{type: string, among: b.names}", "among"),
    ("{type: integer, default: 1, minimum: 0, maximum: 1}", ""),
    ("{type: number, unit: s, default: 0.5, within-timeout: true, setup-times: 1}", ""),
    ("{type: list, default: [], choices: [x]}", ""),
    ("{type: list, of: number, unit: m, per: a, default: [0, 1.5], minimum: 0}", ""),
    ("{type: boolean, default: false}", ""),
    ("{type: string, among: map.obstacles}", ""),
]


def messages(text: str) -> list[str]:
    return [problem.message for problem in inconsistencies(mapping(text))]


@pytest.mark.parametrize(("parameter", "key"), PARAMETERS)
def test_contradictions_of_a_parameter(parameter: str, key: str) -> None:
    text = f"parameters: {{map: {{type: path}}, a: {parameter}}}"
    places = [text[problem.span.column - 1 :].partition(":")[0] for problem in inconsistencies(mapping(text))]
    assert places == ([key] if key else [])


@pytest.mark.parametrize("name", ["cid", "help"])
def test_reserved_names(name: str) -> None:
    expected = f"'--{name}' is a flag of every service, so it cannot name a parameter"
    assert messages(f"parameters: {{{name}: {{type: string}}}}") == [expected]


def test_ports_of_unknown_parameters() -> None:
    text = "parameters: {id: {type: integer}}\nmessages: {in: ['a.B/{id}', 'a.B/{ids}']}\nmemory: {out: ['{name}']}\n"
    assert messages(text + "devices: ['{id}']\n") == [
        "'a.B/{ids}' names the unknown parameter 'ids'",
        "'{name}' names the unknown parameter 'name'",
    ]


def test_ports_of_frames_of_a_map() -> None:
    text = "parameters: {map-path: {type: path}}\nmessages: {in: ['{%s.frames}?']}\n"
    assert messages(text % "map-path") == []
    assert messages(text % "map") == ["'{map.frames}?' names the unknown parameter 'map'"]
