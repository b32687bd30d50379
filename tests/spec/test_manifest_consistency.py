"""Manifests that contradict themselves."""

import pytest

from dodo_dsl.spec.manifest import inconsistencies
from tests.source.nodes import mapping

PARAMETERS = {
    "{type: integer, default: 1.5}": "the default of 'a' is not of type integer",
    "{type: number, unit: m, default: true}": "the default of 'a' is not of type number",
    "{type: string, default: [x]}": "the default of 'a' is not of type string",
    "{type: path, default: x}": "'a' is a path in a test, so it cannot have a default",
    "{type: number, default: 5, maximum: 4}": "the default of 'a' is not between its minimum and its maximum",
    "{type: string, default: x, choices: [y]}": "the default of 'a' is not one of its choices",
    "{type: string, unit: m}": "'unit' is for numbers, but 'a' is of type string",
    "{type: boolean, minimum: 1}": "'minimum' is for numbers, but 'a' is of type boolean",
    "{type: number, choices: [y]}": "'choices' are for strings and lists, but 'a' is of type number",
    "{type: number, unit: m, within-timeout: true}": "'a' is not a duration",
    "{type: number, setup-times: 2}": "'a' is not a duration",
    "{type: number, minimum: 2, maximum: 1}": "the minimum of 'a' is larger than its maximum",
    "{type: number, of: integer}": "'of' is for lists, but 'a' is of type number",
    "{type: list, of: number, default: [x]}": "the default of 'a' is not of type list",
    "{type: list, of: number, unit: m, default: [true]}": "the default of 'a' is not of type list",
    "{type: list, unit: m}": "'unit' is for numbers, but 'a' is of type list",
    "{type: list, per: map}": "'per' names 'map', expected a parameter of type list",
    "{type: string, among: b.names}": "'among' names 'b', expected a parameter of type path",
}
GOOD = [
    "{type: integer, default: 1, minimum: 0, maximum: 1}",
    "{type: number, unit: s, default: 0.5, within-timeout: true, setup-times: 1}",
    "{type: list, default: [], choices: [x]}",
    "{type: list, of: number, unit: m, per: a, default: [0, 1.5], minimum: 0}",
    "{type: boolean, default: false}",
    "{type: string, among: map.obstacles}",
]


def messages(text: str) -> list[str]:
    return [problem.message for problem in inconsistencies(mapping(text))]


@pytest.mark.parametrize("parameter", PARAMETERS)
def test_contradictions_of_a_parameter(parameter: str) -> None:
    assert messages(f"parameters: {{map: {{type: path}}, a: {parameter}}}") == [PARAMETERS[parameter]]


@pytest.mark.parametrize("parameter", GOOD)
def test_parameters_without_contradictions(parameter: str) -> None:
    assert messages(f"parameters: {{map: {{type: path}}, a: {parameter}}}") == []


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
