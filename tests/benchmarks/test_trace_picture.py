"""Traces of runs below one another."""

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest

from benchmarks.pictures.trace_picture import main

SVG = "{http://www.w3.org/2000/svg}"


def trace(path: Path, seconds: float) -> str:
    names = [{"ph": "M", "tid": number, "args": {"name": name}} for number, name in enumerate(["dodo run", "a<b"])]
    spans = [
        {"ph": "X", "tid": 0, "name": "compile", "ts": 0, "dur": 500_000},
        {"ph": "X", "tid": 1, "name": "running & more", "ts": 500_000, "dur": round(seconds * 1e6) - 500_000},
    ]
    path.write_text(json.dumps({"traceEvents": [*names, *spans]}))
    return str(path)


def test_bars_have_one_scale(tmp_path: Path) -> None:
    out = tmp_path / "out.svg"
    before, after = trace(tmp_path / "before.json", 4.5), trace(tmp_path / "after.json", 2.5)
    assert main([str(out), f"before={before}", f"after={after}"]) == 0
    picture = ElementTree.fromstring(out.read_text())
    bars = {
        rect.findtext(f"{SVG}title"): float(rect.get("width", 0)) for rect in picture.iter(f"{SVG}rect") if len(rect)
    }
    assert list(bars) == ["compile: 0.50 s", "running & more: 4.00 s", "running & more: 2.00 s"]
    assert bars["running & more: 4.00 s"] == pytest.approx(2 * bars["running & more: 2.00 s"], abs=0.2)
    texts = [text.text for text in picture.iter(f"{SVG}text")]
    assert {"before: 4.50 s", "after: 2.50 s", "a<b", "4 s"} <= set(texts)


def test_it_says_what_it_takes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["out.svg"]) == 2
    assert "TITLE=TRACE.json" in capsys.readouterr().err
