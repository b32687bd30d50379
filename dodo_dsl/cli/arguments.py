"""The parser of a command line, which suggests what a mistyped word may mean below the usage of its command."""

import argparse
from collections.abc import Sequence
from typing import Any, NoReturn

_NAMES = {"COMMAND": "command", "ACTION": "action"}


class Arguments(argparse.ArgumentParser):
    """Like argparse's parser, but the subcommand itself reports its unknown options."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(self._unknown(unknown[0]))
        return found, unknown

    def error(self, message: str) -> NoReturn:
        from dodo_dsl.search.postgres import masked

        super().error(masked(message))

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Raises ArgumentError, without its own argument, for what is none of an action's choices."""
        if action.choices is not None and value not in action.choices:
            raise argparse.ArgumentError(None, _wrong_choice(action, str(value)))

    def _unknown(self, word: str) -> str:
        option = word.partition("=")[0]
        if not option.startswith("-"):
            return f"'{word}' is one word too many"
        options = [known for action in self._actions for known in action.option_strings if known.startswith("--")]
        return f"unknown option '{option}'" + _hint(option, options)


def _wrong_choice(action: argparse.Action, word: str) -> str:
    known = [str(choice) for choice in action.choices or ()]
    what = "/".join(action.option_strings) or str(action.metavar or action.dest)
    if what in _NAMES:
        return f"unknown {_NAMES[what]} '{word}'" + _hint(word, known)
    return f"{what}: '{word}' is not one of {', '.join(known)}" + _hint(word, known, only_near=True)


def _hint(word: str, known: Sequence[str], *, only_near: bool = False) -> str:
    """A suggestion; the hyphens before an option make no word like another."""
    from dodo_dsl.diagnostics import closest

    names = {option.lstrip("-"): option for option in known}
    if near := closest(word.lstrip("-"), names):
        return "; did you mean " + " or ".join(f"'{names[name]}'" for name in near) + "?"
    return "" if only_near else "; --help shows what there is"
