"""A test that names a kind of rigs is an instance for each of them."""

from dataclasses import replace
from pathlib import Path

from dodo_dsl.source import Scalar
from dodo_dsl.spec.load import of_test, on_each
from dodo_dsl.spec.matrix import Choice
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.registry import Location
from dodo_dsl.spec.rig import Rig
from tests.source.nodes import mapping

CAMERA = "camera: {source: rpicam}\n"
ONE, TWO, MODEL = (
    Rig(name, "dynamic", cid, mapping(f"serial: /dev/{name}\n{CAMERA}"))
    for name, cid in (("one", 121), ("two", 122), ("model", None))
)
BARE = Rig("bare", "dynamic", 123, mapping("kind: dynamic\n"))


def written(rig: str | None) -> Spec:
    return Spec(Location(Path("t.dodo.yml"), Path()), name="t", rig=rig)


def test_a_kind_means_the_only_rig_of_it_or_each_of_several_and_real_ones_first() -> None:
    rigs, spec = {"bare": BARE, "model": MODEL}, written("dynamic")
    assert on_each(spec, {}) == on_each(spec, {"one": replace(ONE, kind="static")}) == [spec]
    for found, expected in (
        (rigs, [("model", "t")]),
        ({**rigs, "one": ONE}, [("one", "t")]),
        ({**rigs, "one": ONE, "two": TWO}, [("one", "t--rig-one"), ("two", "t--rig-two")]),
        ({"dynamic": replace(ONE, kind="static"), "two": TWO}, [("dynamic", "t")]),
    ):
        assert [(each.rig, each.slug) for each in on_each(spec, found)] == expected
    for name in (None, "emulated", "one"):
        assert on_each(written(name), {"one": ONE, "two": TWO}) == [written(name)]


def test_the_test_of_an_instance_has_no_rig_but_what_else_its_name_says() -> None:
    spec = written("dynamic")
    dimension = [("rig", Scalar(spec.span("rig"), "old", "old"))]
    (one, _) = on_each(replace(spec, choice=Choice(tuple(dimension))), {"one": ONE, "two": TWO})
    sample = ("sample", Scalar(spec.span("rig"), "2", "2"))
    sampled = replace(one, choice=Choice((*one.choice.values, sample), (sample,)))
    assert of_test(sampled).title == "t[rig=old,sample=2,sample=2]"
    assert of_test(written("a")) == written("a")
