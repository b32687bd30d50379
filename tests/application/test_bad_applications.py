"""Each bad application is a pair: a compose file, or a folder with ``docker-compose.yml``, and the text about it."""

from pathlib import Path

import pytest

from dodo_dsl.application.read import read_application
from dodo_dsl.diagnostics import format_text, ordered
from dodo_dsl.terminal import WIDE

FOLDER = Path(__file__).parent / "bad"
CASES = sorted(p.stem for p in FOLDER.iterdir() if p.suffix != ".out")


@pytest.mark.parametrize("case", CASES)
def test_diagnostics(case: str, monkeypatch: pytest.MonkeyPatch, update_goldens: bool) -> None:
    monkeypatch.chdir(FOLDER)
    file = Path(f"{case}.yml")
    source, problems = read_application(file if file.is_file() else Path(case) / "docker-compose.yml")
    text = format_text(ordered(problems), WIDE)
    expected = FOLDER / f"{case}.out"
    if update_goldens:
        expected.write_text(text)
    assert text == expected.read_text()
    assert text
    assert (source is None) == any(p.severity == "error" for p in problems)


def test_every_expectation_has_its_file() -> None:
    assert sorted(p.stem for p in FOLDER.glob("*.out")) == CASES
