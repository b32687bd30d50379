"""Set-up and execution of tests as a picture."""

from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.report.duration_plot import Times, draw

SVG = "{http://www.w3.org/2000/svg}"
SECONDS = st.floats(0, 1e6)
RUNS = st.lists(st.tuples(SECONDS, SECONDS), min_size=1, max_size=3)
NAMED = st.dictionaries(st.text(max_size=50), RUNS, min_size=1, max_size=4)


def bars(picture: str) -> list[tuple[str, float, float]]:
    """Title, left edge and width of each bar."""
    found = ElementTree.fromstring(picture).iter(f"{SVG}rect")
    return [(title, float(bar.get("x", "")), float(bar.get("width", ""))) for bar in found if (title := _title(bar))]


def _title(bar: ElementTree.Element) -> str:
    return bar.findtext(f"{SVG}title") or ""


def test_bars_are_as_long_as_their_times_and_the_longest_test_is_on_top() -> None:
    (_, left, setup), (_, middle, execution), (last, *_), _ = bars(
        draw({"short": [(0.5, 1.0)], "long": [(1.0, 3.0), (2.0, 6.0), (2.0, 7.0)]}, "here")
    )
    assert execution / setup == pytest.approx(3.0, rel=0.01)
    assert middle == pytest.approx(left + setup, abs=0.2)
    assert last == "short: set-up 0.50 s, execution 1.00 s"


@given(NAMED)
def test_every_picture_is_xml_with_two_bars_a_test(tests: dict[str, list[Times]]) -> None:
    named = {name.encode("utf-8", "replace").decode(): runs for name, runs in tests.items() if name.isprintable()}
    if named:
        found = bars(draw(named, "<here> & 'there'"))
        assert len(found) == 2 * min(len(named), 60)
        assert all(width >= 0 and left + width <= 861 for _, left, width in found)


def test_the_axis_has_few_round_numbers() -> None:
    picture = ElementTree.fromstring(draw({"test": [(0.3, 6.9)]}, "here"))
    texts = [text.text for text in picture.iter(f"{SVG}text") if text.get("text-anchor") == "middle"]
    assert texts == ["0 s", "1 s", "2 s", "3 s", "4 s", "5 s", "6 s", "7 s"]
