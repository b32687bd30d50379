"""Each bad spec is a pair of files: the spec, and what ``dodo compile --check`` says of it."""

from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main

FOLDER = Path(__file__).parent / "bad"
CASES = sorted(p.name.removesuffix(".dodo.yml") for p in FOLDER.glob("*.dodo.yml"))


def said(case: str) -> tuple[int, str]:
    stdout, stderr = StringIO(), StringIO()
    code = main(["compile", "--check", f"{case}.dodo.yml"], stdout, stderr)
    assert stderr.getvalue() == ""
    return code, stdout.getvalue()


@pytest.mark.parametrize("case", CASES)
def test_diagnostics(case: str, monkeypatch: pytest.MonkeyPatch, update_goldens: bool) -> None:
    monkeypatch.chdir(FOLDER)
    code, text = said(case)
    expected = FOLDER / f"{case}.out"
    if update_goldens:
        expected.write_text(text)
    assert text == expected.read_text()
    assert code == 2
    assert text


def test_every_expectation_has_its_spec() -> None:
    assert sorted(p.stem for p in FOLDER.glob("*.out")) == CASES
