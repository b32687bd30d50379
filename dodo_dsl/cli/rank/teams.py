"""Which results are whose, on the command line of ``dodo rank``."""

from collections.abc import Sequence
from pathlib import Path

from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.rank.score import test_name
from dodo_dsl.outcome import Outcome
from dodo_dsl.report import results
from dodo_dsl.spec.goals import Goal


def load(words: Sequence[str]) -> dict[str, list[Outcome]]:
    """The outcomes of each team, of FILE, FOLDER or NAME=FILE; raises UsageError and ResultsError.

    Files with the same written name are one team's; names of folders have to differ.
    """
    teams: dict[str, list[Outcome]] = {}
    folders: dict[str, str] = {}
    for word in words:
        name, path = _named(word)
        if not name:
            name = path.resolve().parent.name
            if name in folders or name in teams:
                raise UsageError(f"two results are of team '{name}'; name them, as in {name}-2={word}")
            folders[name] = word
        elif name in folders:
            raise UsageError(f"two results are of team '{name}', as '{folders[name]}' is in a folder of that name")
        teams.setdefault(name, []).extend(results.load(path))
    if empty := next((name for name, outcomes in teams.items() if not outcomes), None):
        raise UsageError(f"the results of team '{empty}' have no test")
    _check_goals(teams)
    return teams


def _named(word: str) -> tuple[str, Path]:
    """A team's name, empty where it is not written, and its file."""
    name, equals, file = word.partition("=")
    if equals and name and not Path(word).exists():
        word = file
    else:
        name = ""
    path = Path(word)
    return name, path / results.FILE_NAME if path.is_dir() else path


def _check_goals(teams: dict[str, list[Outcome]]) -> None:
    """Raises UsageError where two runs of a test have other goals: their scores say nothing about each other."""
    known: dict[str, tuple[str, tuple[Goal, ...]]] = {}
    for team, outcomes in teams.items():
        for outcome in outcomes:
            test = test_name(outcome)
            other, goals = known.setdefault(test, (team, outcome.goals))
            if goals != outcome.goals:
                both = f"of '{other}' and '{team}'" if other != team else f"of '{team}'"
                raise UsageError(f"the goals of test '{test}' differ between the results {both}; run it again for one")
