"""What others say is shown as it is, on a terminal and off it."""

import re
from dataclasses import replace

import pytest

from dodo_dsl.cli.live_table import LiveProgress
from dodo_dsl.cli.progress import PlainProgress, count
from tests.cli.terminal import SAID, Terminal, shown, wide
from tests.report.test_report_folder import OUTCOME


@pytest.fixture(autouse=True)
def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    wide(monkeypatch)
    return Terminal()


@pytest.mark.parametrize("text", SAID)
def test_a_terminal_shows_what_was_said(text: str, terminal: Terminal) -> None:
    with LiveProgress(terminal, ["test", "other"]) as progress:
        progress.note(f"noted: {text}")
        progress.phase("test", f"phase: {text}")
        progress.done(OUTCOME)
    with LiveProgress(terminal, ["test"]) as progress:
        progress.phase("test", f"phase: {text}")
    said = shown(terminal.getvalue())
    assert f"noted: {text}" in said
    assert f"phase: {text}" in said
    assert re.search(r"test +failed", said)


@pytest.mark.parametrize("kind", [LiveProgress, PlainProgress])
def test_nothing_said_moves_the_cursor(kind: type[LiveProgress] | type[PlainProgress], terminal: Terminal) -> None:
    with kind(terminal, ["test"]) as progress:
        progress.note("noted\x1b[2J\r::error::x")
        progress.phase("test", "phase\x1b[2J\r::error::x")
    assert "\x1b[2J" not in terminal.getvalue()
    assert "noted�[2J�::error::x" in shown(terminal.getvalue())


def test_counts_in_words() -> None:
    assert [count(0), count(1), count(2), count(1, "stale test")] == ["0 tests", "1 test", "2 tests", "1 stale test"]


def test_a_running_test_has_a_line_with_its_time(terminal: Terminal) -> None:
    with LiveProgress(terminal, ["drive", "look"]) as progress:
        for slug in ("drive", "look"):
            progress.phase(slug, "running")
    said = [" ".join(line.split()[1:]) for line in re.split(r"[\r\n]+", shown(terminal.getvalue())) if line.strip()]
    assert said[-2:] == ["drive running 0:00:00", "look running 0:00:00"]


PASSED = replace(OUTCOME, slug="other", outcome="passed", reason="drove")


def test_what_did_not_pass_stays_above_with_its_reason(terminal: Terminal) -> None:
    with LiveProgress(terminal, ["test", "other", "third"]) as progress:
        progress.done(PASSED)
        progress.done(OUTCOME)
    said = shown(terminal.getvalue())
    assert "test   failed: hit wall" in said
    assert "1 passed, 1 failed, 1 test to go" in said
    assert "drove" not in said and "other" not in said


@pytest.mark.parametrize("is_verbose", [True, False])
def test_steps_of_set_up_are_for_verbose_lines(is_verbose: bool, terminal: Terminal) -> None:
    with PlainProgress(terminal, ["test"], is_verbose) as progress:
        for phase in ("setting up", "waiting for action", "waiting for rig 'a'", "taking down"):
            progress.phase("test", phase)
    lines = [line.split("  ", 2)[-1] for line in terminal.getvalue().splitlines()]
    steps = ["waiting for action"] * is_verbose
    assert lines == ["setting up", *steps, "waiting for rig 'a'", *["taking down"] * is_verbose]
