import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.object_detection.boxes import Box, Thing
from services.object_detection.frames import Kind, Parts
from services.object_detection.tally import Tally, compare

A, B, FAR = Box(0, 0, 0.1, 0.1), Box(0.3, 0, 0.1, 0.1), Box(0.8, 0.8, 0.1, 0.1)
counts = st.integers(0, 1000)


@given(counts, counts, counts)
def test_precision_recall_and_f1_are_those_of_the_thesis(hits: int, false: int, missed: int) -> None:
    tally = Tally(hits, false, missed)
    p, r, f1 = tally.precision, tally.recall, tally.f1
    assert p == (hits / (hits + false) if hits + false else None)
    assert r == (hits / (hits + missed) if hits + missed else None)
    if p and r:
        assert f1 == pytest.approx(2 * p * r / (p + r))
    elif hits + false + missed:
        assert f1 == 0.0
    else:
        assert f1 is None


def test_a_class_only_pairs_with_itself() -> None:
    true = [Thing("yellow", A), Thing("blue", B)]
    found = [Thing("blue", A), Thing("blue", B), Thing("red", FAR)]
    tallies = dict(compare(found, true, 0.5, ()))
    assert tallies == {"yellow": Tally(0, 0, 1), "blue": Tally(1, 1, 0, 1.0), "red": Tally(0, 1, 0)}
    assert compare(found, true, 0.5, ()).total() == Tally(1, 2, 1, 1.0)
    assert dict(compare(found, true, 0.5, ["yellow", "blue"])).keys() == {"yellow", "blue"}


def test_a_threshold_is_to_be_exceeded() -> None:
    half = Box(0, 0, 0.1, 0.05)
    assert compare([Thing("a", half)], [Thing("a", A)], 0.5, ()).total() == Tally(0, 1, 1)
    assert compare([Thing("a", half)], [Thing("a", A)], 0.49, ()).total().hits == 1


def test_parts_join_by_detection_id_whatever_their_order() -> None:
    parts = Parts()
    for number, value in (
        (1, "color:yellow"),
        (2, A),
        (1, B),
        (2, " blue "),
        (3, FAR),
        (4, A),
        (4, Kind(2)),
        (5, "red"),
    ):
        parts.add(number, value)
    assert parts.things() == [Thing("blue", A), Thing("yellow", B), Thing("", FAR), Thing("type 2", A)]


def test_of_one_detection_the_first_word_counts() -> None:
    parts = Parts()
    for value in (A, B, B, "yellow", "blue", Kind(1), Kind(2)):
        parts.add(0, value)
    assert (parts.things(), parts.repeated) == ([Thing("yellow", A)], 2)


def test_no_property_is_no_class() -> None:
    parts = Parts()
    assert not parts
    parts.add(0, "")
    parts.add(0, A)
    assert parts and parts.things() == [Thing("", A)]
