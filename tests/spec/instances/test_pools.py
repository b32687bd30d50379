"""Pools of rigs: an instance of a test for each rig that will do."""

from dataclasses import replace
from pathlib import Path

from dodo_dsl.source import Scalar
from dodo_dsl.spec.load import members, of_test, on_each
from dodo_dsl.spec.matrix import Choice
from dodo_dsl.spec.model import Pool, Spec, pool_of, spec_of
from dodo_dsl.spec.registry import Location
from dodo_dsl.spec.rig import Rig
from tests.source.nodes import mapping

RIGS = {
    name: Rig(name, kind, cid, mapping(f"kind: {kind}\n"))
    for name, kind, cid in (("b", "dynamic", 122), ("desk", "static", 123), ("a", "dynamic", 121))
}


def written(text: str) -> Spec:
    node = mapping(f"name: t\nrig: {text}\n")
    return spec_of(Location(Path("t.dodo.yml"), Path()), node, Choice(), {"rig": node.entries["rig"].value.span}, True)


def rigs(text: str) -> list[str]:
    pool = written(text).pool
    assert pool is not None
    return [rig.name for rig in members(pool, RIGS)]


def test_all_rigs_of_a_kind_or_those_of_a_list() -> None:
    assert rigs("{any: dynamic}") == ["b", "a"]
    assert rigs("{any: [a, none, desk, a]}") == ["a", "desk"]
    assert rigs("{any: circle}") == rigs("{any: []}") == []


def test_an_instance_for_each_rig() -> None:
    found = on_each(written("{any: dynamic}"), RIGS)
    assert [(one.rig, one.title, one.slug) for one in found] == [
        ("b", "t[rig=b]", "t--rig-b"),
        ("a", "t[rig=a]", "t--rig-a"),
    ]


def test_a_kind_means_the_only_rig_of_it_or_a_pool_and_real_ones_first() -> None:
    camera = "camera: {source: rpicam}\n"
    one, two, model = (
        Rig(name, "dynamic", cid, mapping(f"serial: /dev/{name}\n{camera}"))
        for name, cid in (("one", 121), ("two", 122), ("model", None))
    )
    rigs = {"bare": RIGS["a"], "model": model}
    spec = written("dynamic")
    assert on_each(spec, RIGS) == on_each(spec, {"one": replace(one, kind="static")}) == [spec]
    for found, expected in (
        (rigs, [("model", "t")]),
        ({**rigs, "one": one}, [("one", "t")]),
        ({**rigs, "one": one, "two": two}, [("one", "t--rig-one"), ("two", "t--rig-two")]),
        ({"dynamic": replace(one, kind="static"), "two": two}, [("dynamic", "t")]),
    ):
        assert [(each.rig, each.slug) for each in on_each(spec, found)] == expected


def test_the_test_of_an_instance_has_no_rig_but_what_else_its_name_says() -> None:
    spec = written("{any: dynamic}")
    dimension = [("rig", Scalar(spec.span("rig"), "old", "old"))]
    (one, _) = on_each(replace(spec, choice=Choice(tuple(dimension))), RIGS)
    sample = ("sample", Scalar(spec.span("rig"), "2", "2"))
    sampled = replace(one, choice=Choice((*one.choice.values, sample), (sample,)))
    assert of_test(sampled).title == "t[rig=old,sample=2,sample=2]"
    assert of_test(written("a")) == written("a")


def test_other_tests_stay_as_they_are() -> None:
    for text in ("emulated", "a", "{any: circle}", "{some: dynamic}", "{any: 3}", "[a]"):
        spec = written(text)
        assert on_each(spec, RIGS) == [spec], text
    assert (written("a").rig, written("a").pool) == ("a", None)
    assert pool_of(None) is None and Pool().text == "[]"
