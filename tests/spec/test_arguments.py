"""Arguments of services: where values come from, and what they are."""

from pathlib import Path

from dodo_dsl.source import Scalar
from dodo_dsl.spec.arguments import argument, resolved, written
from dodo_dsl.spec.manifest import Manifest, Parameter
from dodo_dsl.spec.model import Spec, Use
from dodo_dsl.spec.registry import Location
from dodo_dsl.spec.rig import Rig
from tests.source.nodes import mapping, value

RATE = Parameter("freq", "number", "Rate.", unit="Hz", default=10, minimum=1)
MAP = Parameter("map-path", "string", "Map.", shared=True)
WIDTH = Parameter("width", "integer", "Width.", rig="camera.width")
MANIFEST = Manifest(Path("/s"), "eye", ("environment",), "eye", (), "Sees.", {p.name: p for p in (RATE, MAP, WIDTH)})
RIG = Rig("kiwi", "static", 121, mapping("camera: {width: 640}", "dodo.yml"))


def use(name: str, parameters: str) -> Use:
    uses = value("eye")
    assert isinstance(uses, Scalar)
    return Use("environment", name, uses.span, uses, dict(mapping(parameters).entries))


def spec(*uses: Use) -> Spec:
    return Spec(Location(Path("/r/a/a.dodo.yml"), Path("/r")), uses=uses)


def test_its_own_value_comes_first() -> None:
    one, other = use("one", "{map-path: a, width: 320}"), use("other", "{map-path: b}")
    test = spec(one, other)
    assert written(test, one, MAP, RIG) is one.parameters["map-path"]
    assert written(test, one, WIDTH, RIG) is one.parameters["width"]


def test_then_another_service_or_the_rig() -> None:
    one, other = use("one", "{}"), use("other", "{map-path: b, width: 1, freq: 5 Hz}")
    test = spec(one, other)
    assert written(test, one, MAP, RIG) is other.parameters["map-path"]
    assert written(test, one, WIDTH, RIG) is RIG.entry("camera.width")
    assert written(test, one, WIDTH, None) is None
    assert written(test, one, RATE, RIG) is None


def test_a_service_that_shares_may_be_named() -> None:
    """So that another service's parameter of the same name, with another meaning, is left alone."""
    one, other = use("one", "{}"), use("other", "{start: 3}")
    for shared, entry in (("eye", other.parameters["start"]), ("ear", None)):
        assert written(spec(one, other), one, Parameter("start", "string", "Begin.", shared=shared), None) is entry


def test_values_defaults_and_problems() -> None:
    one = use("one", "{freq: 0.5 kHz}")
    given = argument(spec(one), one, RATE, None)
    assert (given.text, given.entry, given.problem) == ("500", one.parameters["freq"], None)
    none = use("none", "{}")
    assert argument(spec(none), none, RATE, None).text == "10"
    assert argument(spec(none), none, MAP, None).value is None
    wrong = use("wrong", "{freq: 0 Hz}")
    found = argument(spec(wrong), wrong, RATE, None)
    assert (found.text, found.entry) == (None, wrong.parameters["freq"])
    assert found.problem is not None
    assert found.problem.rule == "out-of-range"


def test_a_service_with_all_its_arguments() -> None:
    one = use("one", "{freq: 5 Hz, other: 1}")
    service = resolved(spec(one), one, MANIFEST, RIG)
    assert list(service.arguments) == ["freq", "map-path", "width"]
    assert service.texts == {"freq": "5", "width": "640"}


def test_arguments_of_the_same_entry_are_taken_over() -> None:
    one = use("one", "{freq: 5 Hz, map-path: a}")
    first = resolved(spec(one), one, MANIFEST, RIG)
    changed = Use(
        one.layer, one.name, one.span, one.uses, {**one.parameters, "freq": use("x", "{freq: 6 Hz}").parameters["freq"]}
    )
    second = resolved(spec(changed), changed, MANIFEST, RIG, first.arguments)
    assert second.arguments["map-path"] is first.arguments["map-path"]
    assert second.arguments["width"] is first.arguments["width"]
    assert (first.texts["freq"], second.texts["freq"]) == ("5", "6")
