"""dodo stats reuse on the shipped registry, beside the thesis' table."""

import io
import json
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
    assert "  in this order           b = 0.43 (0.26 to 0.60), ln a = 1.24 (0.97 to 1.51)" in rows
    assert "  mean of all orders      b = 0.50 (0.41 to 0.60), ln a = 1.29 (1.14 to 1.44)" in rows
    assert "as the thesis states    b = 0.78 (0.63 to 0.92); its a = 0.66 is ln a" in text


def test_json_has_both_orders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    code, text = stats("reuse", "--json")
    document = json.loads(text)
    assert code == 0 and document["thesis"]["in_order"]["services"] == [3, 6, 6, 6, 6, 7, 7, 9, 10]
    assert document["registry"]["averaged"]["services"][-1] == document["registry"]["in_order"]["services"][-1]
    assert document["thesis"]["averaged"]["fit"]["b"] == pytest.approx(0.503, abs=5e-4)


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
