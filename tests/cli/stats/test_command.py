"""dodo stats reuse on the shipped registry."""

import io
import json
import re
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main

ROOT = Path(__file__).parents[3]


def stats(*words: str) -> tuple[int, str]:
    out, err = io.StringIO(), io.StringIO()
    code = main(["stats", *words], out, err)
    return code, out.getvalue() + err.getvalue()


@pytest.mark.thorough
def test_a_table_and_the_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    code, text = stats("reuse")
    shipped = sorted(path.parent.name for path in (ROOT / "tests_registry").glob("*/*.dodo.yml"))
    rows = text.splitlines()
    assert (code, [row.split()[0] for row in rows[1 : len(shipped) + 1]]) == (0, shipped)
    assert "dil-kiwi-track                2         2  rec-replay, continuous-signal" in rows
    assert [row.split("b = ")[0].strip() for row in rows[-2:]] == ["in this order", "mean of all orders"]
    assert all(re.search(r"b = 0\.\d\d \(0\.\d\d to 0\.\d\d\), ln a = \d\.\d\d \(", row) for row in rows[-2:]), rows


def test_json_has_both_orders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    code, text = stats("reuse", "--json")
    document = json.loads(text)
    assert code == 0 and document.keys() == {"dodo", "version", "level", "registry"}
    assert document["registry"]["averaged"]["services"][-1] == document["registry"]["in_order"]["services"][-1]
    assert 0 < document["registry"]["averaged"]["fit"]["b"] < 1


def test_what_cannot_be_read_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\n")
    for name, text in (("a", "action: {pose: {uses: integrator}}"), ("b", "action: [")):
        (tmp_path / "tests" / name).mkdir(parents=True)
        (tmp_path / "tests" / name / f"{name}.dodo.yml").write_text(f"dodo: 1\nname: {name}\n{text}\n")
    monkeypatch.chdir(tmp_path)
    code, text = stats("reuse")
    assert code == 0
    assert "1 tests, 1 services" in text
    assert "tests/b/b.dodo.yml:" in text


def test_without_tests_there_is_nothing_to_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\n")
    (tmp_path / "tests").mkdir()
    monkeypatch.chdir(tmp_path)
    assert stats("reuse") == (2, "dodo stats: the registry has no test that uses a service\n")
