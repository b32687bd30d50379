"""The page of a run: small, and no script but its own."""

import base64
import hashlib
import re
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.outcome import Outcome
from dodo_dsl.report.comparison import compare
from dodo_dsl.report.overview import LinkedFiles, render
from dodo_dsl.report.report_folder import write_summaries
from dodo_dsl.report.results import GivenReport
from tests.report.joined.reports import check, named, write
from tests.report.viewer.chromium import Chromium, Page
from tests.report.viewer.hostile import HOSTILE

TESTS = [
    named("sil-a", reason="drove", setup_s=2.0, execution_s=10.0),
    named("sil-b", outcome="failed", reason="hit wall left", checks=({**check(2, max=1), "name": "wall-margin"},),
          setup_s=10.0, execution_s=9.5),
    named("hil-c", level="hil", outcome="error", reason="no rig"),
    *(named(f"dil-m[light={light},speed={speed}]", level="dil", outcome=("passed", "failed")[light == "dark"])
      for light in ("dark", "day") for speed in (1, 2)),
]  # fmt: skip


def test_the_policy_allows_the_pages_own_script_and_style_alone(tmp_path: Path) -> None:
    page = (write(tmp_path, TESTS) / "index.html").read_text()
    (policy,) = re.findall(r'Content-Security-Policy" content="(.*?)"', page)
    for tag, source in (("script", "script-src"), ("style", "style-src")):
        (text,) = re.findall(f"<{tag}>(.*?)</{tag}>", page, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"{source} 'sha256-{digest}';" in policy
    assert "unsafe" not in policy
    assert policy.startswith("default-src 'none';")
    assert not re.search(r"<[^>]* (style|on\w+)=", page.replace("<script>", ""))


def files(tests: list[Outcome]) -> dict[str, LinkedFiles]:
    logs = {test.slug: [f"{test.slug}/logs/environment.{layer}.log" for layer in "abcdefgh"] for test in tests}
    return {
        s: LinkedFiles([(f"{s}/trajectory.png", "")], logs[s], f"{s}/test.rec", "", f"{s}/drive.html") for s in logs
    }


def test_a_page_of_a_hundred_tests_is_small() -> None:
    """Also when all of 15 checks failed and changed."""
    checks = [tuple({**check(n + old, max=2 * n), "name": f"deviation-{n}"} for n in range(15)) for old in (0.123, 0.5)]
    old, new = (
        [named(f"sil-{n}[light=0.3,speed={n}]", checks=each, last_lines=("frame 12: x",) * 20) for n in range(100)]
        for each in checks
    )
    page = render(new, files(new), compare(new, GivenReport(Path("main/results.json"), old)))
    assert 300_000 < len(page.encode()) < 1_000_000


@pytest.mark.slow
@pytest.mark.xdist_group("chromium")
def test_tests_are_searched_and_filtered(chromium: Chromium, tmp_path: Path) -> None:
    write(tmp_path, TESTS)
    before = [replace(test, outcome="passed") for test in TESTS]
    write_summaries(tmp_path, TESTS, comparison=compare(TESTS, GivenReport(Path("main/results.json"), before)))
    with chromium.page((tmp_path / "index.html").as_uri()) as page:
        names = [test.name for test in (*TESTS[1:2], *TESTS[3:], TESTS[2], TESTS[0])]
        assert shown(page) == names
        for form, expected in (
            ({"search": "WALL hit"}, ["sil-b"]),
            ({"search": "wall-margin"}, ["sil-b"]),
            ({"search": "nothing"}, []),
            ({"outcome": "error"}, ["hil-c"]),
            ({"search": "newly failing sil"}, ["sil-b"]),
        ):
            fill(page, **form)
            assert shown(page) == expected
        page.value("location.hash = 'sil-a'")
        page.wait("!document.getElementById('sil-a').hidden")
        assert shown(page) == names
        assert page.value("document.getElementById('sil-a').querySelector('details').open")
        for width in (390, 1024):
            page.resize(width, 844)
            page.wait("document.documentElement.scrollWidth <= innerWidth")
        assert page.faults == []
        assert [url for url in page.requests if not url.startswith((tmp_path.as_uri(), "data:,"))] == []


@pytest.mark.slow
@pytest.mark.xdist_group("chromium")
def test_another_script_does_not_run_and_all_tests_are_shown_without(chromium: Chromium, tmp_path: Path) -> None:
    page_file = write(tmp_path, TESTS) / "index.html"
    page_file.write_text(page_file.read_text().replace('"use strict";', '"use strict"; window.hacked = 1;'))
    with chromium.page(page_file.as_uri()) as page:
        assert page.value("window.hacked") is None
        assert "Content Security Policy" in str(page.faults)
        assert sorted(shown(page)) == sorted(test.name for test in TESTS)
        assert page.value("document.getElementById('_filters').checkVisibility()") is False


def shown(page: Page) -> list[str]:
    """The names of the tests that can be seen."""
    rows = "Array.from(document.querySelectorAll('.test')).filter(row => row.checkVisibility())"
    return list(page.value(f"{rows}.map(row => row.querySelector('h3').textContent)"))


def fill(page: Page, **values: str) -> None:
    values = {"outcome": "all", **values}
    for name in ("search", "outcome"):
        field = f"document.getElementById('_filters').elements['{name}']"
        page.value(f"{field}.value = '{values.get(name, '')}'")
        page.value(f"{field}.dispatchEvent(new Event('input', {{bubbles: true}}))")


@pytest.mark.slow
@pytest.mark.xdist_group("chromium")
def test_strings_of_others_are_text(chromium: Chromium, tmp_path: Path) -> None:
    texts = [text.encode(errors="replace").decode() for text in HOSTILE]
    checks = tuple({**check(n, max=1, unit=text), "name": text} for n, text in enumerate(texts))
    outcomes = [
        replace(named(f"t-{n}", outcome="failed", spec=text, description=text, reason=text, checks=checks[n : n + 1]),
                name=text, notes=(text,), last_lines=(text,))
        for n, text in enumerate(texts)
    ]  # fmt: skip
    old = [replace(test, outcome="passed", checks=({**test.checks[0], "value": -1, "ok": True},)) for test in outcomes]
    write_summaries(tmp_path, outcomes, comparison=compare(outcomes, GivenReport(Path(texts[0]), old)))
    with chromium.page((tmp_path / "index.html").as_uri()) as page:
        page.value("document.querySelectorAll('details').forEach(each => { each.open = true; })")
        tags = "img, svg:not(.bar), iframe, base, body style, body link, body meta"
        tags = f"Array.from(document.querySelectorAll('{tags}'), e => e.outerHTML)"
        assert page.value(tags) == []
        assert page.value("document.querySelectorAll('script').length") == 1
        assert page.value("[window.hacked, {}.polluted]") == [None, None]
        text = page.value("document.body.textContent")
        assert [each for each in HOSTILE[:18] if text.count(each) < 8] == []
        assert not re.search("[\x00-\x08\x0b-\x1f\u202a-\u202e\u2066-\u2069\u2028\u2029]", text)
        assert page.value("document.querySelectorAll('a[href]:not([href^=\"#\"])').length") == 0
        fill(page, search="onmouseover")
        assert len(shown(page)) == 1
        assert page.faults == []
        assert [url for url in page.requests if not url.startswith((tmp_path.as_uri(), "data:,"))] == []
    assert (tmp_path / "index.html").stat().st_size < 1_000_000


def test_a_matrix_is_one_row_and_what_did_not_pass_comes_first() -> None:
    names = re.findall("<h3>(?:<a[^>]*>)?([^[<]*)", render(TESTS, files(TESTS)))
    assert names == ["sil-b", "dil-m", *["dil-m"] * 4, "hil-c", "sil-a"]
