"""The help of every command, which begins with its module's first line."""

import ast
import subprocess
import sys

import pytest

from dodo_dsl.cli.main import COMMANDS, main, parser


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_examples(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "--help"], None, None) == 0  # type: ignore[arg-type]
    shown = capsys.readouterr().out
    assert f"usage: dodo {command}" in shown
    assert f"\nexamples:\n  dodo {command}" in shown
    about = COMMANDS[command]
    assert (about.load().__doc__ or "").startswith(f"dodo {command}: {about.summary}.")


def loaded(*words: str) -> set[str]:
    """The modules that a command loads, in a process of its own."""
    code = f"import io, sys; from dodo_dsl.cli.main import main; main({list(words)}, io.StringIO(), io.StringIO()); "
    code += "print(list(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(ast.literal_eval(done.stdout.splitlines()[-1]))


def test_help_loads_no_command() -> None:
    """What every command needs is loaded, and nothing of what one of them does."""
    found = {name for name in loaded("--help") if name.startswith("dodo_dsl.") or name in ("numpy", "jinja2")}
    assert found <= {f"dodo_dsl.{name}" for name in ("cli", "cli.errors", "cli.exits", "cli.main", "terminal")}


@pytest.mark.thorough
def test_a_list_loads_nothing_of_plans() -> None:
    parts = ("dodo_dsl.plan", "dodo_dsl.emit", "dodo_dsl.run", "dodo_dsl.report", "jinja2", "numpy")
    assert [name for name in loaded("list", "--services") if name.startswith(parts)] == []


def test_no_words_are_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([], None, None) == 2  # type: ignore[arg-type]
    assert capsys.readouterr().err.startswith("usage: dodo")


def test_every_argument_is_explained() -> None:
    """No option without help, in any command or action."""
    pending = [parser()]
    seen = 0
    while pending:
        for action in pending.pop()._actions:
            choices = action.choices
            if isinstance(choices, dict):
                pending += choices.values()
            elif action.metavar not in ("FILE.rec", "ACTION", "COMMAND"):
                seen += 1
                assert action.help, action
    assert seen > 80
