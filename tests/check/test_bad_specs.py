"""Each bad spec is a pair: the spec, or a folder with a deployment, and the output of ``dodo compile --check``."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.cli import pipeline_file
from tests.emit.readers import run

FOLDER = Path(__file__).parent / "bad"
SPECS = sorted(p.name.removesuffix(".dodo.yml") for p in FOLDER.glob("*.dodo.yml"))
DEPLOYMENTS = sorted(p.parent.name for p in FOLDER.glob("*/dodo.yml"))
CASES = [*SPECS, *DEPLOYMENTS]


def slow_where_large(names: Iterable[str]) -> list[Any]:
    """Names as parameters; those that need hundreds of instances are slow."""
    return [pytest.param(name, marks=[pytest.mark.slow] if name == "pipeline-limit" else []) for name in names]


def said(case: str, patch: pytest.MonkeyPatch) -> tuple[int, str]:
    """The exit code and the output, in the folder of the case, which is its repository's."""
    patch.setattr(pipeline_file, "_top", lambda root: root)
    patch.chdir(FOLDER / case if case in DEPLOYMENTS else FOLDER)
    code, out, err = run("compile", "--check", *([f"{case}.dodo.yml"] if case in SPECS else []))
    return code, out + err


def expected(case: str) -> str:
    return (FOLDER / f"{case}.out").read_text()


@pytest.mark.parametrize("case", slow_where_large(CASES))
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
