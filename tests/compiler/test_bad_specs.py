"""Each bad spec is a pair: the spec, or a folder with a deployment, and what ``dodo compile --check`` says of it."""

from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main

FOLDER = Path(__file__).parent / "bad"
SPECS = sorted(p.name.removesuffix(".dodo.yml") for p in FOLDER.glob("*.dodo.yml"))
DEPLOYMENTS = sorted(p.parent.name for p in FOLDER.glob("*/dodo.yml"))
CASES = [*SPECS, *DEPLOYMENTS]


def said(case: str, patch: pytest.MonkeyPatch) -> tuple[int, str]:
    """The exit code and what stands on the screen, for one who is in the folder of the case."""
    stdout, stderr = StringIO(), StringIO()
    patch.chdir(FOLDER / case if case in DEPLOYMENTS else FOLDER)
    words = ["compile", "--check"] + ([f"{case}.dodo.yml"] if case in SPECS else [])
    code = main(words, stdout, stderr)
    return code, stdout.getvalue() + stderr.getvalue()


def expected(case: str) -> str:
    return (FOLDER / f"{case}.out").read_text()


@pytest.mark.parametrize("case", CASES)
def test_diagnostics(case: str, monkeypatch: pytest.MonkeyPatch, update_goldens: bool) -> None:
    code, text = said(case, monkeypatch)
    if update_goldens:
        (FOLDER / f"{case}.out").write_text(text)
    assert text == expected(case)
    assert code == (2 if " error[" in text else 0)
    assert "error[" in text or "warning[" in text


def test_every_expectation_has_its_spec() -> None:
    assert sorted(p.stem for p in FOLDER.glob("*.out")) == sorted(CASES)
    assert not set(SPECS) & set(DEPLOYMENTS)
