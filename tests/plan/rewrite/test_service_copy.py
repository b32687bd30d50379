"""Changes of a copy, and what is noted about them."""

from tests.plan.rewrite.copies import copy


def test_a_key_that_is_removed() -> None:
    own = copy({"restart": "always", "ports": None})
    assert own.remove("restart", "containers are not restarted") == "always"
    assert own.remove("ports") is None
    assert own.remove("links") is None
    assert own.service == {}
    assert own.changes == ["a: restart removed, containers are not restarted"]


def test_items_that_remain() -> None:
    own = copy({"links": ["b", "c"]})
    own.keep_items("links", ["b"])
    assert own.service == {"links": ["b"]}
    own.keep_items("links", [])
    own.keep_items("dns", [])
    assert own.service == {}


def test_notes_are_short_and_printable() -> None:
    own = copy({})
    own.note("x\ny" + "z" * 300)
    assert own.changes[0].startswith("a: x?yzz")
    assert (len(own.changes[0]), own.changes[0][-3:]) == (200, "...")


def test_the_network_of_a_test() -> None:
    assert copy({}).setting.own_network
    assert not copy({}, isolation="host").setting.own_network
