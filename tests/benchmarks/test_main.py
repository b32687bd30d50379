"""The command, with runs of benchmarks that need no time."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from benchmarks.ledger import __main__ as command
from benchmarks.ledger.ledger import Bench
from benchmarks.ledger.row import Row
from benchmarks.ledger.runner import Interrupted
from tests.benchmarks.rows import ledger, rated

Runs = list[tuple[str, Path, float]]


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Runs]:
    """Makes each run of a benchmark give these rows, and notes name, checkout and seconds of each."""

    def give(*rows: Row, failed: bool = False) -> Runs:
        found: Runs = []

        def run(script: Path, seconds: float) -> Bench:
            found.append((script.stem, script.parents[1], seconds))
            return Bench(script.stem, rows, 1.0, seconds, (0.0, 0.0), "ended with 3" if failed else "", failed)

        monkeypatch.setattr(command, "run", run)
        return found

    return give


@pytest.mark.thorough
def test_it_writes_both_files_and_prints_the_table(
    tmp_path: Path, runs: Callable[..., Runs], capsys: pytest.CaptureFixture[str]
) -> None:
    noted = runs(rated(1, 2, 3))
    assert command.main(["rec", "bench_bus", "-o", str(tmp_path), "--seconds", str(command.TOTAL / 10)]) == 0
    assert [(name, place) for name, place, _ in noted] == [("bench_bus", command.ROOT), ("bench_rec", command.ROOT)]
    assert noted[0][2] == pytest.approx(command.SECONDS["bench_bus"] / 10)
    table = (tmp_path / "ledger.md").read_text()
    assert "| bus  | 20 messages/s | a peer |" in table and table in capsys.readouterr().out
    assert json.loads((tmp_path / "ledger.json").read_text())["benches"][1]["name"] == "bench_rec"


@pytest.mark.thorough
def test_an_interrupt_keeps_what_was_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The table is there, in its files, too; rows that were not measured say why."""

    def run(script: Path, seconds: float) -> Bench:
        load = (0.0, 0.0)
        if script.stem == "bench_compile":
            row = rated(4, 5, 6, what="half")
            raise Interrupted(Bench(script.stem, (row,), 1.0, seconds, load, "interrupted"))
        return Bench(script.stem, (rated(1, 2, 3, what=script.stem),), 1.0, seconds, load)

    monkeypatch.setattr(command, "run", run)
    assert command.main(["bus", "camera", "compile", "rec", "-o", str(tmp_path)]) == 130
    table = (tmp_path / "ledger.md").read_text()
    assert table in capsys.readouterr().out
    rows = {line.split("|")[1].strip(): line.split("|")[2].strip() for line in table.splitlines() if "|" in line}
    assert rows["bench_bus"] == rows["bench_camera"] == "20 messages/s"
    assert (rows["half"], rows["bench_rec"]) == ("50 messages/s", "not measured")
    assert "| interrupted before it |" in table


@pytest.mark.parametrize(("before", "code", "verdict"), [((5, 6, 7), 1, "worse"), ((1, 2, 3), 0, "within the spread")])
def test_a_worse_row_fails_the_command(
    tmp_path: Path, runs: Callable[..., Runs], before: tuple[float, ...], code: int, verdict: str
) -> None:
    ledger(rated(*before), commit="old").write(tmp_path / "old.json")
    runs(rated(1, 2, 3))
    assert command.main(["bus", "-o", str(tmp_path), "--against", str(tmp_path / "old.json")]) == code
    table = (tmp_path / "ledger.md").read_text()
    assert " against old\n" in table and f"| {verdict} " in table


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["buss"], "unknown benchmark 'buss'; there are bus, camera"),
        (["--against", "absent.json"], "No such file or directory: 'absent.json'"),
        (["--against", "pyproject.toml"], "pyproject.toml: not a ledger of version 1"),
    ],
)
def test_wrong_words_are_told_before_anything_runs(
    words: list[str], message: str, runs: Callable[..., Runs], capsys: pytest.CaptureFixture[str]
) -> None:
    noted = runs()
    assert command.main(words) == 2
    assert message in capsys.readouterr().err and not noted
