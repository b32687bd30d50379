"""What ``dodo compile --check`` finds in each row's files, in the folder ``rows``."""

from pathlib import Path

import pytest

from dodo_dsl.check import catalogue
from tests.check import rows

FILES = sorted(rows.ROWS.glob("*.yml"))
ROWS = [
    pytest.param(row, id=f"{file.stem}-{row.name}", marks=[pytest.mark.slow] if row.slow else [])
    for file in FILES
    for row in rows.read(file)
]


@pytest.mark.parametrize("row", ROWS)
def test_found(row: rows.Row, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert rows.found(row, tmp_path, monkeypatch) == row.found


def test_each_rule_is_found() -> None:
    lines = [line for file in FILES for row in rows.read(file) for line in row.found]
    assert {line.removeprefix("warning ").split()[0] for line in lines} == set(catalogue.pages())
