"""Ways of another report, which may come from a stranger, beside the pages of this one."""

import json
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.report import join
from dodo_dsl.report.comparison import compare
from dodo_dsl.report.results import read_given
from dodo_dsl.report.viewer.encoded import packed, script
from tests.report.joined.reports import drive, named, write

PASSED = named("a")


def way(**changes: Any) -> dict[str, Any]:
    fields = [{"name": name, "values": packed([0.0, 1.0])} for name in (*join.FIELDS, "more")]
    channel = {"message": "opendlv.sim.Frame", "sender": 2, "every": 1, "times": packed([0.0, 0.1]), "fields": fields}
    document = json.loads(drive(PASSED).partition("= ")[2].rstrip(";\n"))
    frame = {"message": "opendlv.sim.Frame", "sender": 2}
    return {**document, "scene": {"frame": frame}, "channels": [{**channel, **changes}]}


def compared(folder: Path, data: str) -> Path:
    """The folder of a test, compared with that of a report whose ``drive.js`` has this text."""
    write(folder / "new", [named("a", outcome="failed"), named("b")])
    write(folder / "old", [PASSED])
    (folder / "old" / "a" / "drive.js").write_text(data)
    given = read_given(folder / "old")
    join.write_other_ways(folder / "new", compare(read_given(folder / "new").outcomes, given), given)
    return folder / "new" / "a"


def test_the_way_is_beside_the_page_until_nothing_is_compared(tmp_path: Path) -> None:
    place = compared(tmp_path, script(way()))
    text = (place / "before.js").read_text()
    assert text.startswith("var dodoBefore = {")
    document = json.loads(text.partition("= ")[2].rstrip(";\n"))
    assert (document["outcome"], document["times"]) == ("passed", packed([0.0, 0.1]))
    assert [field["name"] for field in document["fields"]] == list(join.FIELDS)
    assert 'src="before.js"' in (place / "drive.html").read_text()
    assert not (place.parent / "b" / "before.js").exists()
    join.write_other_ways(place.parent, None, None)
    assert not (place / "before.js").exists()
    assert "before.js" not in (place / "drive.html").read_text()


@pytest.mark.parametrize(
    "data",
    [
        "alert(1)",
        script(way()) + "alert(1)",
        script(way(times="<script>")),
        script(way(times=packed([0.0]))),
        script(way(fields=[])),
        script(way(fields=3)),
        script(way(sender=3)),
        script({**way(), "scene": []}),
        script({**way(), "version": 0}),
    ],
)
def test_what_is_no_way_is_left_out(tmp_path: Path, data: str) -> None:
    place = compared(tmp_path, data)
    assert not (place / "before.js").exists()
    assert "before.js" not in (place / "drive.html").read_text()
